#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/backend_turn.h"
#include "core/decompose/decompositions.h"
#include "core/query/segmenter.h"
#include "core/render/feature_maps.h"
#include "kernels/scratch_bytes.h"

// Implementation of Segmenter, for its own .cc files only: the operations on the device.

namespace pepeseg {

// Everything except `model` and `decompositions` may be used only inside WithDevice, which holds
// the device lock. The other member functions assume that the caller holds it.
struct Segmenter::State {
  State(Backend& b, Model m, MapCounts* counts)
      : backend(b),
        model(std::move(m)),
        renderer(b, model),
        maps(renderer, MapReserve(LargestView(model.views)), counts),
        sums(b, kNumSegmentSums) {}

  // Runs `work` under the device lock and returns its result. Afterwards frees scratch memory that
  // a view larger than every view of the model took, so that one large free camera does not keep
  // it.
  template <typename Work>
  auto WithDevice(Work work) {
    return InTurn(backend, [&] {
      auto answer = work();
      renderer.ReleaseOversized();
      if (mask.capacity() > WithReserve(MostPixels(LargestView(model.views)))) {
        mask = {};
        similarity = {};
      }
      return answer;
    });
  }

  // Returns the features at pixels, y * width + x, as rendered and not gated: [pixels, 32].
  absl::StatusOr<std::vector<float>> FeaturesAt(const ModelView& view,
                                                std::span<const int32_t> pixels);
  // Returns the gates psi(scale): [scales, 32].
  Buffer<float> GatesAt(std::span<const double> scales) const;
  // Returns the similarity of each pixel to `queries` [queries, 32], on the device:
  // [queries, height, width].
  absl::StatusOr<Buffer<float>> SimilarityTo(const Buffer<float>& queries, double scale,
                                             const ModelView& target);
  // Returns the mask of a query in one view. `queries` are its features in the order of
  // PositiveFirst.
  absl::StatusOr<SegmentResult> SegmentView(const Query& query, const Buffer<float>& queries,
                                            const ModelView& target, bool want_similarity);
  absl::StatusOr<LevelCounts> CountLevels(const Query& query, std::span<const double> scales,
                                          std::span<const float> thresholds,
                                          const ModelView& target);
  // Returns the features of a query in the order that ops take, positive ones first: [features,
  // 32].
  Buffer<float> PositiveFirst(const Query& query) const;
  // Returns the feature map of a view on the host, [height * width, 32]. Maps of a subset are
  // rendered each time and not cached.
  absl::StatusOr<std::vector<Half>> DownloadFeatures(const ModelView& view,
                                                     const GaussianSet* subset);

  Backend& backend;
  const Model model;
  ModelRenderer renderer;
  FeatureMaps maps;
  // Scratch of SegmentView, kept from call to call.
  Buffer<uint8_t> mask;
  Buffer<float> similarity;
  Buffer<int64_t> sums;
  Decompositions decompositions;  // has its own mutex
};

}  // namespace pepeseg
