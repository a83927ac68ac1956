def check_target(path, plot=False):
    pass
