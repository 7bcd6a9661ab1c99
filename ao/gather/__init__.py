"""Hemispheres at points: receivers, ray origins, directions and the estimator."""
