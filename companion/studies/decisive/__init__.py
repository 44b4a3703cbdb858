"""The decisive experiment: the paper's recipe and the best that we know, trained to the end, judged by every rule."""
