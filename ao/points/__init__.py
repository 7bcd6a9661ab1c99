"""What is baked: receivers of occlusion, corner samples of folds, Morton order."""
