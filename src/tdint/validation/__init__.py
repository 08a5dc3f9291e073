"""Published and exact results, beside those of this installation"""
