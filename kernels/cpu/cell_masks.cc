#include "kernels/ops/cell_masks.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/math/warp_cell.h"

namespace pepeseg {
namespace {

// Appends the runs of a scanline of a mask: first pixel, and after the last.
void AppendRuns(const EnlargeMasksArgs& args, const int8_t* mask, int y, const WarpedCell& row,
                const std::vector<WarpedCell>& columns, std::vector<int32_t>& runs) {
  const uint8_t* ignored =
      args.ignored.empty() ? nullptr : args.ignored.data + int64_t{y} * args.photo_width;
  bool inside = false;
  for (int x = 0; x < args.photo_width; ++x) {
    const bool holds = (ignored == nullptr || ignored[x] == 0) &&
                       WarpedLogit(mask, args.extent, columns[x], row) > 0;
    if (holds != inside) runs.push_back(x);
    inside = holds;
  }
  if (inside) runs.push_back(args.photo_width);
}

}  // namespace

void CpuBackend::SuppressMasks(const SuppressMasksArgs& args) {
  if (failed()) return;
  std::vector<int64_t> kept;  // candidates
  const auto mask_of = [&](int64_t i) {
    return args.bits.data + int64_t{args.candidates[i]} * args.words;
  };
  const auto needless = [&](int64_t i, int64_t better) {
    const uint32_t *a = mask_of(i), *b = mask_of(better);
    int64_t common = 0;
    for (int word = 0; word < args.words; ++word) common += std::popcount(a[word] & b[word]);
    const int64_t united = int64_t{args.areas[i]} + args.areas[better] - common;
    if (united > 0 && static_cast<double>(common) / static_cast<double>(united) > args.max_iou) {
      return true;
    }
    const int32_t cell = args.filler_cells[i];
    return cell >= 0 && (b[cell / 32] >> (cell % 32) & 1) != 0;
  };
  for (int64_t i = 0; i < args.candidates.size; ++i) {
    args.kept[i] =
        std::none_of(kept.begin(), kept.end(), [&](int64_t better) { return needless(i, better); });
    if (args.kept[i] == 0) continue;
    std::copy_n(mask_of(i), args.words,
                args.kept_bits.data + static_cast<int64_t>(kept.size()) * args.words);
    kept.push_back(i);
  }
}

// A task is a mask.
void CpuBackend::EnlargeMasks(const EnlargeMasksArgs& args) {
  if (failed()) return;
  const int64_t num_masks = args.masks.size;
  std::vector<std::vector<int32_t>> runs(static_cast<size_t>(num_masks));
  if (!args.first_run->Reserve(*this, num_masks * args.photo_height + 1)) return;
  int32_t* const first_run = args.first_run->span().data;
  const auto columns = CellsOfPixels(args.cells_per_pixel, args.photo_width, args.width, true);
  const auto rows = CellsOfPixels(args.cells_per_pixel, args.photo_height, args.height, false);
  pool_.ParallelFor(num_masks, [&](int64_t i, int) {
    const int8_t* mask = args.quarters.data + int64_t{args.masks[i]} * args.extent * args.extent;
    for (int y = 0; y < args.photo_height; ++y) {
      first_run[i * args.photo_height + y] = static_cast<int32_t>(runs[i].size() / 2);
      AppendRuns(args, mask, y, rows[y], columns, runs[i]);
    }
  });
  // Scanlines count from the first run of their mask so far.
  int64_t before = 0;
  for (int64_t i = 0; i < num_masks; ++i) {
    for (int y = 0; y < args.photo_height; ++y) {
      first_run[i * args.photo_height + y] += static_cast<int32_t>(before);
    }
    before += static_cast<int64_t>(runs[i].size() / 2);
  }
  first_run[num_masks * args.photo_height] = static_cast<int32_t>(before);
  if (!args.runs->Reserve(*this, 2 * before)) return;
  int32_t* out = args.runs->span().data;
  for (const std::vector<int32_t>& mask : runs) out = std::copy(mask.begin(), mask.end(), out);
}

}  // namespace pepeseg
