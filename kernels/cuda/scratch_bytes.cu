#include "kernels/cuda/blend_tile.cuh"
#include "kernels/cuda/cuda_backend.h"
#include "kernels/scratch_bytes.h"

// Memory that rendering and its backward pass need on CUDA, computed from the element types of the
// scratch's own buffers, so that it follows changes of those. The buffers are sized in project.cu,
// render.cu and render_backward.cu; a buffer that is added there must be added here.

namespace pepeseg {

int64_t CudaBackend::ScratchBytes(const ScratchSize& size) const {
  // The tile-entry capacity of a render is the number of entries at the last visit of the view and
  // a margin, see EntryRooms.
  const int64_t num_entries = size.num_entries + size.num_entries / 5;
  const RenderScratch s;
  const int64_t by_gaussian = BytesOfRow(s.cuda.gaussian_visible, s.visible_gaussian,
                                         s.visible_splat, s.visible_first_slot) +
                              (size.for_backward ? BytesOfRow(s.visible_grad) : 0);
  constexpr int64_t kSlotSums = 10;  // numbers an entry in CudaScratch::slot_sums
  const int64_t by_entry = BytesOfRow(s.entry_visible, s.entry_slot, s.cuda.unsorted_slot,
                                      s.cuda.slot_visible, s.cuda.sort_keys, s.cuda.sort_keys) +
                           (size.for_backward ? kSlotSums * BytesOfRow(s.cuda.slot_sums) : 0);
  const int64_t by_tile =
      BytesOfRow(s.tile_first_entry, s.cuda.tile_first_bucket, s.cuda.tile_order) +
      (size.for_backward ? 4 * kTilePixels * BytesOfRow(s.cuda.pixel_color) : 0);
  const int64_t by_bucket =
      size.for_backward
          ? BytesOfRow(s.cuda.bucket_tile) + 4 * kTilePixels * BytesOfRow(s.cuda.bucket_color)
          : 0;
  // ImageLoss keeps three maps of gradients for each of three channels.
  constexpr int64_t kLossMaps = 9 * static_cast<int64_t>(sizeof(float));
  const int64_t by_pixel = BytesOfRow(s.pixel_transmittance, s.pixel_last_entry) + kLossMaps;
  // Histograms of the sorts, partial sums of the loss, and padding of the buffers.
  constexpr int64_t kFixed = 16 << 20;
  return WithReserve(
             by_gaussian * size.num_gaussians + by_entry * num_entries + by_tile * size.num_tiles +
             by_bucket * MaxBuckets(num_entries, size.num_tiles) + by_pixel * size.num_pixels) +
         kFixed;
}

}  // namespace pepeseg
