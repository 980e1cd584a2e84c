#pragma once

#include <cstdint>
#include <vector>

#include "core/render/frozen_scene.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Rows of the blend matrix on the host: those of pixel i are the entries [first[i], first[i + 1]).
struct HostRows {
  explicit HostRows(const CapturedRows& rows);
  size_t num_rows() const { return first.empty() ? 0 : first.size() - 1; }

  std::vector<int32_t> first, gaussian;
  std::vector<float> weight;
};

// See GridPixels; without ignored ones.
std::vector<int32_t> KnownGridPixels(const View& view, double max_cells);

}  // namespace pepeseg
