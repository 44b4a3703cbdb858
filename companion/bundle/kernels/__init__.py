"""Triton kernels of a bundle on a GPU: LSTM steps, convolutions and Adam.

PyTorch's own kernels spend most of a small batch's time between launches.
"""
