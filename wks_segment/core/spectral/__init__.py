"""From a surface to its signature: Laplacian, eigensolvers, Wave Kernel Signature."""
