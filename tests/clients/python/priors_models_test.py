"""Tests pepeseg_priors with the real classes of transformers, tiny and with random weights: inputs and
outputs must fit. Skipped if torch or transformers is missing."""

import importlib.util
import unittest

import numpy as np

from pepeseg_priors import models

MISSING = [name for name in ("torch", "transformers") if importlib.util.find_spec(name) is None]


def noise(height, width):
    return np.random.default_rng(5).integers(0, 256, (height, width, 3), dtype=np.uint8)


@unittest.skipIf(MISSING, f"{' and '.join(MISSING)} cannot be imported here")
class TinyModelsTest(unittest.TestCase):
    def test_sam(self):
        import torch
        import transformers as t

        torch.manual_seed(1)
        config = t.SamConfig(
            vision_config=t.SamVisionConfig(
                hidden_size=32, output_channels=32, num_hidden_layers=2, num_attention_heads=4,
                image_size=64, patch_size=16, window_size=2, global_attn_indexes=[1], mlp_dim=64,
                num_pos_feats=16,
            ).to_dict(),
            prompt_encoder_config=t.SamPromptEncoderConfig(
                hidden_size=32, image_size=64, patch_size=16
            ).to_dict(),
            mask_decoder_config=t.SamMaskDecoderConfig(
                hidden_size=32, mlp_dim=64, num_attention_heads=4, iou_head_hidden_dim=32
            ).to_dict(),
        )
        processor = t.SamImageProcessor(
            size={"longest_edge": 64}, pad_size={"height": 64, "width": 64}
        )
        generator = t.pipeline(
            "mask-generation", model=t.SamModel(config).eval(), image_processor=processor,
            # Random weights give low scores: all thresholds let everything pass.
            pred_iou_thresh=-1e9, stability_score_thresh=-1.0,
        )
        masks = models.masks_of(generator)(noise(48, 64))
        self.assertGreater(len(masks), 0)
        for mask in masks:
            self.assertEqual((mask.pixels.shape, mask.pixels.dtype), ((48, 64), np.bool_))
            self.assertTrue(np.isfinite(mask.score))

    def test_depth_anything(self):
        import torch
        import transformers as t

        torch.manual_seed(1)
        backbone = t.Dinov2Config(
            hidden_size=32, num_hidden_layers=4, num_attention_heads=2, image_size=56,
            patch_size=14, out_features=["stage1", "stage2", "stage3", "stage4"],
            reshape_hidden_states=False,
        )
        config = t.DepthAnythingConfig(
            backbone_config=backbone, patch_size=14, reassemble_hidden_size=32,
            neck_hidden_sizes=[8, 8, 16, 16], fusion_hidden_size=8, head_hidden_size=8,
        )
        processor = t.DPTImageProcessor(
            size={"height": 56, "width": 56}, keep_aspect_ratio=True, ensure_multiple_of=14
        )
        estimator = t.pipeline(
            "depth-estimation", model=t.DepthAnythingForDepthEstimation(config).eval(),
            image_processor=processor,
        )
        maps = models.depth_of(estimator)([noise(56, 84), noise(56, 84)])
        self.assertEqual(len(maps), 2)
        for depth in maps:
            self.assertFalse(depth.far_is_large)
            self.assertEqual(depth.values.ndim, 2)
            self.assertTrue(np.isfinite(depth.values).all())


if __name__ == "__main__":
    unittest.main()
