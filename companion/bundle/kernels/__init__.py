"""Triton kernels of a bundle on a GPU: steps of an LSTM, and convolutions.

PyTorch's own kernels spend most of a small batch's time between launches.
"""
