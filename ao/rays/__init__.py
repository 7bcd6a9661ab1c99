"""The rays of a point: directions, the traversal of them together, and the estimator."""
