#include "kernels/cpu/splat_order.h"

#include <array>
#include <bit>
#include <cassert>
#include <cstdint>
#include <utility>
#include <vector>

#include "kernels/backend.h"
#include "kernels/math/blend.h"

// Sorting the visible splats once by depth and then appending each to its tiles gives every tile's
// entries in order of depth, without sorting the far more numerous entries. Serial and stable, so
// the order is fixed.

namespace pepeseg {
namespace {

constexpr int kDigitBits = 11;
constexpr int kNumDigits = 1 << kDigitBits;

// Stable least-significant-digit radix sort by the upper 32 bits. Both arrays are overwritten;
// returns the one that holds the result.
uint64_t* RadixSort(uint64_t* keys, uint64_t* spare, int64_t count) {
  constexpr int kNumPasses = 3;
  std::array<std::array<int32_t, kNumDigits>, kNumPasses> starts = {};
  const auto digit = [](uint64_t key, int pass) {
    return static_cast<int>(key >> (32 + pass * kDigitBits)) & (kNumDigits - 1);
  };
  // One pass counts the digits of all passes.
  for (int64_t i = 0; i < count; ++i) {
    for (int pass = 0; pass < kNumPasses; ++pass) ++starts[pass][digit(keys[i], pass)];
  }
  for (int pass = 0; pass < kNumPasses; ++pass) {
    int32_t next = 0;
    for (int32_t& start : starts[pass]) next += std::exchange(start, next);
    for (int64_t i = 0; i < count; ++i) spare[starts[pass][digit(keys[i], pass)]++] = keys[i];
    std::swap(keys, spare);
  }
  return keys;
}

// Returns the visible by ascending depth, in the lower 32 bits, or nullptr when out of memory.
// Depths are positive, so their bits order as they do. Once the keys are taken, depths are inverted
// if the inverse is to be blended.
const uint64_t* SortByDepth(Backend& backend, RenderScratch& scratch) {
  const int64_t num_visible = scratch.visible_splat.size();
  if (!scratch.sort_keys.Reserve(backend, 2 * num_visible)) return nullptr;
  uint64_t* keys = scratch.sort_keys.span().data;
  Splat* splats = scratch.visible_splat.span().data;
  for (int64_t i = 0; i < num_visible; ++i) {
    assert(keys != nullptr);
    keys[i] = uint64_t{std::bit_cast<uint32_t>(splats[i].depth)} << 32 | static_cast<uint64_t>(i);
    if (scratch.inverse_depth) splats[i].depth = InverseDepth(splats[i].depth);
  }
  return RadixSort(keys, keys + num_visible, num_visible);
}

}  // namespace

void ListTileEntries(Backend& backend, RenderScratch& scratch) {
  const int64_t num_visible = scratch.visible_splat.size();
  const int num_tiles = scratch.num_tiles_x * scratch.num_tiles_y;
  const int32_t* first_slot = scratch.visible_first_slot.span().data;
  const int32_t* first_run = scratch.visible_first_run.span().data;
  const TileRun* runs = scratch.runs.span().data;
  if (!scratch.tile_first_entry.Reserve(backend, num_tiles + 1) ||
      !scratch.entry_visible.Reserve(backend, first_slot[num_visible]) ||
      !scratch.entry_slot.Reserve(backend, first_slot[num_visible])) {
    return;
  }
  int32_t* tile_first = scratch.tile_first_entry.span().data;
  int32_t* entry_visible = scratch.entry_visible.span().data;
  int32_t* entry_slot = scratch.entry_slot.span().data;
  assert(tile_first != nullptr);

  // Counts the entries of each tile by differences: plus one where a run starts, minus one where it
  // ends. Their running sum is the count, and the running sum of counts the first entry.
  std::vector<int32_t> change(num_tiles + 1), next(num_tiles);
  for (int64_t i = 0; i < scratch.runs.size(); ++i) {
    ++change[runs[i].first_tile];
    --change[runs[i].first_tile + runs[i].count];
  }
  int32_t first = 0, count = 0;
  for (int tile = 0; tile < num_tiles; ++tile) {
    tile_first[tile] = next[tile] = first;
    first += count += change[tile];
  }
  tile_first[num_tiles] = first;

  const uint64_t* order = SortByDepth(backend, scratch);
  if (order == nullptr) return;
  for (int64_t i = 0; i < num_visible; ++i) {
    const auto visible = static_cast<int32_t>(order[i] & 0xffffffffu);
    // Slots of a splat follow its runs, so their order does not depend on depth.
    int32_t slot = first_slot[visible];
    for (int32_t r = first_run[visible]; r < first_run[visible + 1]; ++r) {
      for (int32_t tile = runs[r].first_tile; tile < runs[r].first_tile + runs[r].count; ++tile) {
        const int32_t entry = next[tile]++;
        assert(entry_visible != nullptr && entry_slot != nullptr);
        entry_visible[entry] = visible;
        entry_slot[entry] = slot++;
      }
    }
  }
}

}  // namespace pepeseg
