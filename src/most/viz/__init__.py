"""Pictures and recordings.

``bev.draw_bev`` draws truth, prediction and errors of a scan as seen from above; ``scene.write_scene`` writes a
sequence for the rerun viewer (extra ``viz``, which nothing else here needs).
"""
