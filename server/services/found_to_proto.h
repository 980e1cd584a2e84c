#pragma once

#include <cstdint>
#include <vector>

#include "core/find/scene_segments.h"
#include "pepeseg/v1/find.pb.h"

namespace pepeseg {

// Returns how clients name a segment of a decomposition at kPieceDecompositionScales: at the
// default scales where these have it, which they do of a piece that is all of a segment.
v1::SegmentRef RefOf(const SceneSegments& all, int32_t segment);

// Writes segments of a model into answers to FindSegments, with what shows them in pixels of a
// frame. Both must outlive it. For one thread.
class FoundWriter {
 public:
  FoundWriter(const Model& model, const SceneSegments& all, FrameKind kind)
      : model_(model), all_(all), kind_(kind) {}

  // Sets all of `found` that follows from a segment: a prompt by the mask of the view that shows
  // most of it, unless `found` has a prompt.
  void Write(int32_t segment, v1::FindSegmentsResponse::Found& found);

 private:
  void AddAppearance(const SeenView& seen, int32_t segment,
                     v1::FindSegmentsResponse::Found& found) const;
  v1::Prompt PromptIn(const SeenView& seen, int32_t segment);

  const Model& model_;
  const SceneSegments& all_;
  const FrameKind kind_;
};

}  // namespace pepeseg
