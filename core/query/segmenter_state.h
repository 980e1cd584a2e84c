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

// The inside of Segmenter, for its own files only.

namespace pepeseg {

// All but the model and the decompositions is used in a turn of the backend.
struct Segmenter::State {
  State(Backend& b, Model m, MapCounts* counts)
      : backend(b),
        model(std::move(m)),
        renderer(b, model),
        maps(renderer, MapReserve(LargestView(model.views)), counts),
        sums(b, kNumSegmentSums) {}

  // InTurn, and what a view larger than memory is set aside for took is given back.
  template <typename Work>
  auto Turn(Work work) {
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

  // [pixels, 32] as rendered, not gated.
  absl::StatusOr<std::vector<float>> FeaturesAt(const ModelView& view,
                                                std::span<const int32_t> pixels);
  Buffer<float> GatesAt(std::span<const double> scales) const;  // psi(scale): [scales, 32]
  // [queries, height, width] of `queries` [queries, 32], on the backend.
  absl::StatusOr<Buffer<float>> SimilarityTo(const Buffer<float>& queries, double scale,
                                             const ModelView& target);
  absl::StatusOr<SegmentResult> SegmentView(const Query& query, const Buffer<float>& queries,
                                            const ModelView& target, bool want_similarity);
  absl::StatusOr<LevelCounts> CountLevels(const Query& query, std::span<const double> scales,
                                          std::span<const float> thresholds,
                                          const ModelView& target);
  // Features of a query as ops take them, the positive ones first: [features, 32].
  Buffer<float> PositiveFirst(const Query& query) const;
  // [height * width, 32]; only maps of all Gaussians are kept.
  absl::StatusOr<std::vector<Half>> DownloadFeatures(const ModelView& view,
                                                     const GaussianSet* subset);

  Backend& backend;
  const Model model;
  ModelRenderer renderer;
  FeatureMaps maps;
  Buffer<uint8_t> mask;
  Buffer<float> similarity;
  Buffer<int64_t> sums;
  Decompositions decompositions;  // has its own mutex
};

}  // namespace pepeseg
