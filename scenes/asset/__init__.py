"""One model of a mesh file, which every format is read into, and which whatever uses a mesh file takes."""
