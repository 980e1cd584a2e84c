#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/scene/capture.h"
#include "kernels/backend.h"

namespace pepeseg {

// A photograph of the training set in backend memory, at one size.
struct TrainingView {
  PinholeView pinhole;
  Buffer<uint8_t> photo;   // [H, W, 3]
  Buffer<uint8_t> ignore;  // [H, W]; empty when nothing is left out
};

// The capture's training views, uploaded once as bytes. With `coarse`, also at 1/2 and 1/4 of their
// size, averaged over blocks of pixels; a block with an ignored pixel is ignored.
class TrainingViews {
 public:
  TrainingViews(Backend& backend, const Capture& capture, bool coarse);

  int size() const { return static_cast<int>(views_.size()); }
  // shrink: 1, or 2 or 4 when made with `coarse`.
  const TrainingView& At(int view, int shrink) const { return views_[view][shrink / 2]; }
  int64_t max_pixels() const { return max_pixels_; }
  int64_t num_pixels() const { return num_pixels_; }  // of all views at full size
  bool allocated() const { return allocated_; }       // false: the backend is out of memory

 private:
  static constexpr int kNumSizes = 3;
  std::vector<std::array<TrainingView, kNumSizes>> views_;  // by shrink / 2
  int64_t max_pixels_ = 0, num_pixels_ = 0;
  bool allocated_ = true;
};

}  // namespace pepeseg
