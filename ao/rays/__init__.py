"""The rays of a point: directions, the traversal of them together, packets of them in Embree, and the estimator."""
