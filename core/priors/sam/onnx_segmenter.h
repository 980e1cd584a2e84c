#pragma once

#include <memory>

#include "core/priors/sam/onnx_graph.h"
#include "core/priors/sam/prompted_segmenter.h"
#include "core/priors/sam/sam_networks.h"

namespace pepeseg {

// Returns the changes to the decoder's graph for OnnxSegmenter. As shipped, it takes one prompt a
// run and returns the best mask. Here all four masks and their IoUs become outputs, and the number
// of prompts becomes free. The image's tensors are no longer repeated for each prompt: broadcasting
// computes the image side of the first attention layer once per run, which is exact and was
// measured to save a fifth of the time. The branch for masks as prompts is dropped.
OnnxGraphEdit PointDecoderEdit();

// Returns the changes for prompts by masks: all four masks and their IoUs become outputs, and the
// inputs are those for one prompt of points and a mask.
OnnxGraphEdit MaskDecoderEdit();

// Returns a segmenter for the photographs of one thread, by networks with one of the edits, which
// must outlive it. The encoder runs once per photograph and its embedding is kept; the decoder runs
// for each batch of prompts. With MaskDecoderEdit (`mask_prompts`), it answers SegmentByMask, and
// Segment for one prompt; with PointDecoderEdit, only Segment.
std::unique_ptr<PromptedSegmenter> MakeOnnxSegmenter(const SamNetworks& networks,
                                                     bool mask_prompts);

}  // namespace pepeseg
