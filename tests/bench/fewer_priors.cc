#include "tests/bench/fewer_priors.h"

#include <random>
#include <utility>
#include <vector>

namespace pepeseg {
namespace {

MaskSet WithoutSome(const MaskSet& masks, double dropped, std::mt19937_64& random) {
  std::vector<BinaryMask> kept;
  for (int mask = 0; mask < masks.num_masks; ++mask) {
    if (static_cast<double>(random() >> 11) * 0x1p-53 < dropped) continue;
    kept.push_back(masks.Extract(mask));
  }
  return BuildMaskSet(masks.width, masks.height, kept);
}

}  // namespace

void Reduce(const CaptureShare& share, CapturePack& pack) {
  std::mt19937_64 random(7);
  std::vector<View>& views = pack.capture.views;
  int num_training = 0;
  size_t num_kept = 0;
  for (size_t v = 0; v < views.size(); ++v) {
    if (!views[v].held_out && num_training++ % share.every_view != 0) continue;
    View view = std::move(views[v]);
    if (share.dropped_masks > 0) view.masks = WithoutSome(view.masks, share.dropped_masks, random);
    if (share.without_depth) view.depth = {};
    for (TruthLevel& level : pack.truth) std::swap(level.labels[num_kept], level.labels[v]);
    views[num_kept++] = std::move(view);
  }
  views.resize(num_kept);
  for (TruthLevel& level : pack.truth) level.labels.resize(num_kept);
}

}  // namespace pepeseg
