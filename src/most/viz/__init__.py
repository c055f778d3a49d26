"""Pictures: ``bev.draw_bev`` draws truth, prediction and errors of a scan as seen from above."""
