// Memory of the machine, and the memory that a render takes.
#include <malloc.h>

#include <cstdint>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/host_memory.h"
#include "kernels/scratch_bytes.h"

namespace pepeseg {

DeviceMemory CpuBackend::memory() const { return HostMemory(); }

// Returns free pages of the heap to the system; no-op without glibc.
void CpuBackend::ReleaseFreed() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

// Counts the buffers of a RenderScratch. Temporary vectors of the ops are not counted.
int64_t CpuBackend::ScratchBytes(const ScratchSize& size) const {
  const RenderScratch s;
  const int64_t by_gaussian =
      BytesOfRow(s.candidate_gaussian, s.candidate_splat, s.candidate_num_tiles,
                 s.candidate_num_runs, s.visible_gaussian, s.visible_splat, s.visible_first_slot,
                 s.visible_first_run, s.sort_keys, s.sort_keys) +
      (size.for_backward ? BytesOfRow(s.visible_grad) : 0);
  // A run covers at least one entry, so there are at most as many runs.
  const int64_t by_entry = BytesOfRow(s.entry_visible, s.entry_slot, s.runs) +
                           (size.for_backward ? BytesOfRow(s.slot_grad) : 0);
  const int64_t by_tile = BytesOfRow(s.tile_first_entry);
  const int64_t by_pixel = BytesOfRow(s.pixel_transmittance, s.pixel_last_entry);
  constexpr int64_t kFixed = 4096;  // counters and the ends of prefix sums
  return WithReserve(by_gaussian * size.num_gaussians + by_entry * size.num_entries +
                     by_tile * size.num_tiles + by_pixel * size.num_pixels) +
         kFixed;
}

}  // namespace pepeseg
