"""The equations of a scene: model, joints, loads, evaluation, consistent start, diagnosis."""
