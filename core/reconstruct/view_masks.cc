#include "core/reconstruct/view_masks.h"

namespace pepeseg {

ViewMasks::ViewMasks(Backend& backend, const Capture& capture) {
  for (const View& view : capture.views) {
    if (!view.held_out) views_.push_back(Upload(backend, view.masks));
  }
}

// Clears allocated_ when the backend is out of memory.
ViewMasks::Masks ViewMasks::Upload(Backend& backend, const MaskSet& masks) {
  Masks out;
  if (masks.empty()) return out;
  any_ = true;
  const auto upload = [&]<class T>(const std::vector<T>& host, Buffer<T>& buffer) {
    const auto size = static_cast<int64_t>(host.size());
    buffer = Buffer<T>(backend, size);
    if (buffer.size() == size) {
      buffer.Upload(host);
    } else {
      allocated_ = false;
    }
  };
  out.words = masks.words;
  upload(masks.pixel_patch, out.pixel_patch);
  upload(masks.patch_bits, out.patch_bits);
  upload(masks.mask_area, out.mask_area);
  return out;
}

PatchMap ViewMasks::At(int view) const {
  const Masks& masks = views_[view];
  return {masks.words, masks.pixel_patch.span(), masks.patch_bits.span(), masks.mask_area.span()};
}

}  // namespace pepeseg
