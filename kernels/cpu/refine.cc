#include "kernels/math/refine.h"

#include <algorithm>
#include <bit>
#include <cassert>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/load_shape.h"

// Refinement in three steps: rank the visible Gaussians in parallel, find the key of the last
// candidate serially, refine the candidates in parallel. Each task writes only its own Gaussians;
// outside parts go to slots by visible and are compacted serially, in their order.

namespace pepeseg {
namespace {

constexpr int64_t kChunk = 256;  // visible Gaussians of a task
constexpr uint64_t kNoCandidate = ~uint64_t{0};

// Returns the rank of a visible Gaussian: the bits of its distance to the rendered depth, which
// order as the distance does, above its index, which orders equal distances. kNoCandidate if it is
// not refinable, or its mean is outside the image or at a pixel of unknown depth.
uint64_t CandidateKey(const RefineGaussiansArgs& args, int64_t visible) {
  const RenderScratch& render = *args.render;
  if (args.refinable[render.visible_gaussian.span()[visible]] == 0) return kNoCandidate;
  const Splat& splat = render.visible_splat.span()[visible];
  const auto width = static_cast<float>(args.view.width);
  const auto height = static_cast<float>(args.view.height);
  if (!(0 <= splat.x && splat.x < width && 0 <= splat.y && splat.y < height)) return kNoCandidate;
  const int64_t pixel =
      static_cast<int64_t>(splat.y) * args.view.width + static_cast<int64_t>(splat.x);
  const float gap = DepthGap(args.alpha[pixel], args.depth[pixel], splat.depth);
  if (gap < 0) return kNoCandidate;
  return uint64_t{std::bit_cast<uint32_t>(gap)} << 32 | static_cast<uint64_t>(visible);
}

// Writes the first two counts and returns the largest key of a candidate, or 0 if there is none.
uint64_t LastCandidateKey(const RefineGaussiansArgs& args) {
  const int64_t num_visible = args.render->visible_gaussian.size();
  const uint64_t* keys = args.scratch->keys.span().data;
  uint64_t* ranked = args.scratch->keys.span().data + num_visible;
  const uint64_t* end = std::copy_if(keys, keys + num_visible, ranked,
                                     [](uint64_t key) { return key != kNoCandidate; });
  const int64_t num_ranked = end - ranked;
  const auto num_candidates =
      static_cast<int64_t>(args.candidate_share * static_cast<double>(num_ranked));
  args.counts[kNumRefineRanked] = num_ranked;
  args.counts[kNumRefineCandidates] = num_candidates;
  if (num_candidates == 0) return 0;
  // Keys are distinct, so the candidates are those up to the key of the last one.
  std::nth_element(ranked, ranked + num_candidates - 1, ranked + num_ranked);
  return ranked[num_candidates - 1];
}

// Writes mean and log scale to six planes, `stride` apart.
void StoreShape(const GaussianShape<float>& shape, float* first, int64_t stride) {
  const float values[] = {shape.mean.x,      shape.mean.y,      shape.mean.z,
                          shape.log_scale.x, shape.log_scale.y, shape.log_scale.z};
  for (int64_t k = 0; k < 6; ++k) first[k * stride] = values[k];
}

// Makes Gaussian i start Adam from scratch.
void ForgetMoments(const RefineGaussiansArgs& args, int64_t i) {
  for (int k = 0; k < NumPlanes(args.gaussians.sh_degree); ++k) {
    args.moment1.Plane(k)[i] = args.moment2.Plane(k)[i] = 0;
  }
  args.num_steps[i] = 0;
}

// Refines one candidate if it crosses a mask, and sets its outside_position to 0 (made shorter) or
// 1 (with an outside part); it stays -1 if nothing is done.
void RefineOne(const RefineGaussiansArgs& args, const ProjectionCamera<float>& camera,
               int64_t visible) {
  const int64_t num_visible = args.render->visible_gaussian.size();
  const int64_t i = args.render->visible_gaussian.span()[visible];
  const GaussianShape<float> shape = LoadShape(args.gaussians, i);
  const PatchMapView masks = MakePatchMapView(args.masks, args.view);
  const Refinement<float> refinement = FindRefinement(camera, shape, masks);
  if (!refinement.found) return;
  StoreShape(PartOf(shape, refinement, false), args.gaussians.data + i, args.gaussians.stride);
  ForgetMoments(args, i);
  args.refinable[i] = 0;
  const bool split = args.split && HasOutsidePart(refinement);
  args.scratch->outside_position.span()[visible] = split ? 1 : 0;
  // `shape` is the shape before the refinement, of which both are parts.
  if (split) {
    StoreShape(PartOf(shape, refinement, true), args.scratch->outside_shape.span().data + visible,
               num_visible);
  }
}

// Moves the outside parts together, in the order of the visible, up to the capacity, and writes the
// last two counts.
void CompactOutsideParts(const RefineGaussiansArgs& args) {
  const int64_t num_visible = args.render->visible_gaussian.size();
  const int64_t room = args.outside_source.size;
  int64_t num_refined = 0, num_split = 0;
  for (int64_t visible = 0; visible < num_visible; ++visible) {
    const int32_t outcome = args.scratch->outside_position.span()[visible];
    num_refined += outcome >= 0;
    if (outcome < 1 || num_split == room) continue;
    args.outside_source[num_split] = args.render->visible_gaussian.span()[visible];
    for (int64_t k = 0; k < 6; ++k) {
      args.outside_shape[k * room + num_split] =
          args.scratch->outside_shape.span()[k * num_visible + visible];
    }
    ++num_split;
  }
  args.counts[kNumRefined] = num_refined;
  args.counts[kNumRefineSplit] = num_split;
}

}  // namespace

void CpuBackend::RefineGaussians(const RefineGaussiansArgs& args) {
  if (failed()) return;
  assert(args.outside_shape.size == 6 * args.outside_source.size);
  std::fill_n(args.counts.data, kNumRefineCounts, 0);
  const int64_t num_visible = args.render->visible_gaussian.size();
  if (num_visible == 0 || args.masks.mask_area.empty()) return;
  RefineScratch& scratch = *args.scratch;
  if (!scratch.keys.Reserve(*this, 2 * num_visible) ||
      !scratch.outside_shape.Reserve(*this, 6 * num_visible) ||
      !scratch.outside_position.Reserve(*this, num_visible)) {
    return;
  }
  uint64_t* keys = scratch.keys.span().data;
  const auto in_chunks = [&](const auto& body) {
    pool_.ParallelFor((num_visible + kChunk - 1) / kChunk, [&](int64_t chunk, int) {
      const int64_t end = std::min(num_visible, (chunk + 1) * kChunk);
      for (int64_t visible = chunk * kChunk; visible < end; ++visible) body(visible);
    });
  };
  in_chunks([&](int64_t visible) { keys[visible] = CandidateKey(args, visible); });
  const uint64_t last_key = LastCandidateKey(args);
  const bool any = args.counts[kNumRefineCandidates] > 0;
  const auto camera = MakeProjectionCamera<float>(args.view);
  in_chunks([&](int64_t visible) {
    scratch.outside_position.span()[visible] = -1;
    if (any && keys[visible] <= last_key) RefineOne(args, camera, visible);
  });
  CompactOutsideParts(args);
}

}  // namespace pepeseg
