"""Points to bake: receivers of occlusion, corner samples of folds, Morton order."""
