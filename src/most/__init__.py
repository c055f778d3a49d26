"""MOST: modal segmentation and tracking, detection-centric lidar panoptic segmentation (IROS 2023).

The pipeline, stage by stage:

1. ``most.datasets`` reads sweeps and makes windows of them (``most.simulation`` writes trees it can read);
2. ``most.modal`` turns point labels into modal centres, extents and velocities, and those into targets;
3. ``most.voxels`` puts points into voxels;
4. ``most.backbones`` encode the voxels (``most.sparse`` convolves them) into BEV and voxel features;
5. ``most.heads`` read centre heat maps, heights, extents, velocities and classes off them;
6. ``most.detections`` picks the peaks; ``most.membership`` says which point belongs to which centre;
7. ``most.panoptic`` fuses both into a label for every point;
8. ``most.tracking`` gives instances identities over time;
9. ``most.metrics`` scores it, ``most.viz`` draws it, ``most.stages`` trains it.
"""

import os

# Threads that spin while they wait for work stall each other wherever two programs share the processors. The OpenMP
# runtime reads this when torch loads it, hence here, before anything imports torch.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
