"""The rays of a point: directions, the traversal of them together, Embree's packets, and the estimator."""
