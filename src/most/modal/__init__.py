"""Modal labels: what the points of an instance say about it, and the targets made of that (paper, section III).

``instances`` holds the table of a sequence, ``build`` makes it from labelled sweeps and ``cache`` keeps it on disk;
``extent`` has the strategies that read half-sizes off its ``outline``; ``targets`` (with ``heatmap``) and
``voxel_labels`` feed the losses.
"""
