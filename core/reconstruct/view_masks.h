#pragma once

#include <cstdint>
#include <vector>

#include "core/scene/capture.h"
#include "kernels/backend.h"

namespace pepeseg {

// The masks of a capture's training views in backend memory, for refinement (METHOD.md section
// 1.5): as mask cells at full size (see MaskSet). Views are numbered as in TrainingViews.
class ViewMasks {
 public:
  ViewMasks(Backend& backend, const Capture& capture);

  bool any() const { return any_; }              // true: at least one view has masks
  bool allocated() const { return allocated_; }  // false: the backend is out of memory
  bool HasMasks(int view) const { return !views_[view].mask_area.empty(); }
  PatchMap At(int view) const;

 private:
  struct Masks {
    int words = 0;
    Buffer<uint32_t> pixel_patch;
    Buffer<uint64_t> patch_bits;
    Buffer<int64_t> mask_area;
  };

  Masks Upload(Backend& backend, const MaskSet& masks);

  bool any_ = false;
  bool allocated_ = true;
  std::vector<Masks> views_;
};

}  // namespace pepeseg
