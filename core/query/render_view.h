#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/frame.h"
#include "core/query/segmenter.h"
#include "core/scene/capture.h"
#include "core/scene/gaussians.h"
#include "core/scene/mask_set.h"
#include "core/scene/model.h"

namespace pepeseg {

enum class RenderContent { kColor, kDepth, kSegments, kFeatures };

struct RenderRequest {
  ModelView view;
  FrameKind frame = FrameKind::kPhotograph;  // of the image
  RenderContent content = RenderContent::kColor;
  double share = 1;                   // size of the image, of that of the frame, (0, 1]
  std::optional<GaussianSet> subset;  // renders only these Gaussians; absent: all
  // With kColor only: tints the pixels of a mask of any size, or those to which a set contributes
  // most.
  std::optional<BinaryMask> overlay;
  ImageSize overlay_size;
  std::optional<GaussianSet> overlay_set;
  // Of kSegments: the scales of the decomposition, and the level to render, from 0.
  std::vector<double> scales;
  int level = 0;
  double feature_scale = 0;  // of kFeatures: quantile, [0, 1]

  // Returns the size of the image, at least 1 x 1.
  ImageSize Size() const;
};

// The image of a view; only the values of the content are there.
struct RenderedView {
  ImageSize size;
  Image color;               // of kColor and kFeatures
  std::vector<float> depth;  // [height, width] of kDepth, scene units; 0: nothing is there
  std::vector<int32_t> ids;  // [height, width] of kSegments, from 1; 0: no segment
};

// Renders a view at the resolution of the image, warped by the lens if there is one. Features are
// not rendered larger than they were trained, so that they look as clicks see them. Errors are
// those of Segmenter.
absl::StatusOr<RenderedView> RenderFrame(const Segmenter& segmenter, const RenderRequest& request);

}  // namespace pepeseg
