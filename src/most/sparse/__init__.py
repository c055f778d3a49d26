"""Sparse 3-D convolution on any device: occupied sites, kernel maps between them, one functional, three modules."""

from most.sparse.conv import sparse_conv
from most.sparse.kernel_map import KernelMap
from most.sparse.modules import InverseConv, SparseTensor, StridedConv, SubmanifoldConv
from most.sparse.sites import Sites

__all__ = ["InverseConv", "KernelMap", "Sites", "SparseTensor", "StridedConv", "SubmanifoldConv", "sparse_conv"]
