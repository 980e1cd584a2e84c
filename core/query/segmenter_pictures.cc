// What Segmenter shows of a model, rather than asks it.
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/query/check_prompt.h"
#include "core/query/segmenter.h"
#include "core/query/segmenter_state.h"
#include "core/render/feature_palette.h"
#include "core/render/id_image.h"

namespace pepeseg {
namespace {

absl::Status CheckSubset(const GaussianSet* subset, const Model& model) {
  const auto count = static_cast<size_t>(model.gaussians.count);
  if (subset == nullptr || subset->member.size() == count) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("the subset is of ", subset->member.size(),
                                                 " Gaussians, the model has ", count));
}

}  // namespace

absl::StatusOr<Image> Segmenter::RenderColor(const ModelView& view,
                                             const GaussianSet* subset) const {
  RETURN_IF_ERROR(CheckView(view));
  RETURN_IF_ERROR(CheckSubset(subset, model()));
  return state_->Turn([&] { return state_->renderer.Color(view, subset); });
}

absl::StatusOr<PixelRows> Segmenter::Rows(const ModelView& view,
                                          std::span<const int32_t> pixels) const {
  RETURN_IF_ERROR(CheckView(view));
  return state_->Turn([&] { return state_->renderer.Rows(view, pixels); });
}

absl::StatusOr<std::vector<float>> Segmenter::RenderDepth(const ModelView& view,
                                                          const GaussianSet* subset) const {
  RETURN_IF_ERROR(CheckView(view));
  RETURN_IF_ERROR(CheckSubset(subset, model()));
  return state_->Turn([&] { return state_->renderer.Depth(view, subset); });
}

absl::StatusOr<Image> Segmenter::RenderFeatures(const ModelView& view, double scale,
                                                const GaussianSet* subset) const {
  RETURN_IF_ERROR(CheckView(view));
  RETURN_IF_ERROR(CheckScale(scale));
  RETURN_IF_ERROR(CheckSubset(subset, model()));
  ASSIGN_OR_RETURN(const std::vector<Half> map,
                   state_->Turn([&] { return state_->DownloadFeatures(view, subset); }));
  return PaintFeatures(MakeFeaturePalette(model().field, scale), map, view.camera);
}

absl::StatusOr<std::vector<int32_t>> Segmenter::RenderIds(const ModelView& view,
                                                          std::span<const int32_t> ids,
                                                          const GaussianSet* subset) const {
  RETURN_IF_ERROR(CheckView(view));
  RETURN_IF_ERROR(CheckSubset(subset, model()));
  if (static_cast<int64_t>(ids.size()) != model().gaussians.count) {
    return absl::InvalidArgumentError(
        absl::StrCat(ids.size(), " ids, the model has ", model().gaussians.count, " Gaussians"));
  }
  return pepeseg::RenderIds(view, ids, [&](const ModelView& of, std::span<const int32_t> pixels) {
    return state_->Turn([&] { return state_->renderer.Rows(of, pixels, subset); });
  });
}

absl::Status Segmenter::WithDecomposition(
    std::span<const double> scales,
    absl::FunctionRef<absl::Status(const Decomposition&)> use) const {
  const auto rows = [this](const ModelView& view, std::span<const int32_t> pixels) {
    return Rows(view, pixels);
  };
  return state_->decompositions.With(
      scales, [&] { return Decompose(state_->backend, model(), scales, rows); }, use);
}

}  // namespace pepeseg
