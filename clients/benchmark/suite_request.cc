#include "clients/benchmark/suite_request.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "clients/benchmark/evaluation_truth.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/picture.h"
#include "clients/terminal/view_picture.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

// Returns a mask as an image of the photograph's size, 0 and 255.
absl::StatusOr<GreyPicture> MaskOf(const fs::path& path, const PixelSize& photograph) {
  ASSIGN_OR_RETURN(GreyPicture mask, ReadGreyPicture(path));
  const double step = static_cast<double>(mask.width) / photograph.width;
  // The rounding of a shrunk side by one pixel, in pixels of the photograph.
  if (std::abs(mask.height / step - photograph.height) > std::max(1.0, 1 / step)) {
    return absl::InvalidArgumentError(
        absl::StrCat(path.string(), ": ", mask.width, "x", mask.height,
                     " pixels, which is not the shape of the photograph, ", photograph.width, "x",
                     photograph.height));
  }
  if (PixelSize{mask.width, mask.height} != photograph) {
    mask = Resized(mask, photograph.width, photograph.height);
  }
  for (uint8_t& pixel : mask.pixels) pixel = pixel != 0 ? 255 : 0;
  return mask;
}

// Returns the union of masks.
absl::StatusOr<GreyPicture> UnionOf(const std::vector<fs::path>& paths,
                                    const PixelSize& photograph) {
  GreyPicture whole{photograph.width, photograph.height, {}};
  whole.pixels.resize(static_cast<size_t>(photograph.width) * photograph.height, 0);
  for (const fs::path& path : paths) {
    ASSIGN_OR_RETURN(const GreyPicture mask, MaskOf(path, photograph));
    for (size_t i = 0; i < whole.pixels.size(); ++i) whole.pixels[i] |= mask.pixels[i];
  }
  return whole;
}

// Adds views of the model to a request, each once.
class RequestViews {
 public:
  RequestViews(const std::vector<v1::View>& views, v1::EvaluateModelRequest& request)
      : request_(request) {
    for (const v1::View& view : views) known_[view.view()] = &view;
  }

  // Returns the truth of a view, which is added if it is new.
  absl::StatusOr<v1::ViewTruth*> Truth(const std::string& view) {
    if (const auto there = truth_.find(view); there != truth_.end()) return there->second;
    if (!known_.contains(view)) {
      return absl::InvalidArgumentError(absl::StrCat("the model has no view \"", view,
                                                     "\"; its photograph may have got no pose"));
    }
    v1::ViewTruth* truth = request_.add_views();
    truth->set_view(view);
    return truth_[view] = truth;
  }
  // The view is one of the model.
  PixelSize Size(const std::string& view) const { return PhotographSize(*known_.at(view)); }

 private:
  v1::EvaluateModelRequest& request_;
  std::map<std::string, const v1::View*> known_;
  std::map<std::string, v1::ViewTruth*> truth_;
};

absl::Status AddPrompt(const ReferencePrompt& from, RequestViews& views,
                       v1::EvaluateModelRequest& request) {
  RETURN_IF_ERROR(views.Truth(from.view).status());
  const PixelSize size = views.Size(from.view);
  if (from.positive.empty() && from.mask.empty()) {
    (*request.mutable_own_masks())[from.entity] = from.view;
    return absl::OkStatus();
  }
  v1::Prompt& prompt = (*request.mutable_prompts())[from.entity];
  prompt.mutable_view()->set_view(from.view);
  if (!from.positive.empty()) {
    ASSIGN_OR_RETURN(const GreyPicture positive, UnionOf(from.positive, size));
    ASSIGN_OR_RETURN(const GreyPicture negative, UnionOf(from.negative, size));
    auto& scribbles = *prompt.mutable_scribbles();
    scribbles.mutable_positive()->set_png(EncodePng(positive));
    if (!from.negative.empty()) scribbles.mutable_negative()->set_png(EncodePng(negative));
  } else {
    ASSIGN_OR_RETURN(const GreyPicture mask, MaskOf(from.mask, size));
    prompt.mutable_mask()->set_png(EncodePng(mask));
  }
  return absl::OkStatus();
}

}  // namespace

v1::EvaluationProtocol ProtocolOf(Benchmark benchmark) {
  switch (benchmark) {
    case Benchmark::kSpinNerf:
    case Benchmark::kLerfMask:
      return v1::EVALUATION_PROTOCOL_LABEL_PROPAGATION;
    case Benchmark::kNvos:
    case Benchmark::kLerfMaskFine:
      return v1::EVALUATION_PROTOCOL_PROMPTABLE;
    case Benchmark::kScene:
      break;
  }
  return v1::EVALUATION_PROTOCOL_PROMPT;
}

absl::StatusOr<v1::EvaluateModelRequest> ScoreRequest(Benchmark benchmark,
                                                      const BenchmarkScene& scene,
                                                      v1::EvaluationProtocol protocol,
                                                      const std::vector<v1::View>& views) {
  v1::EvaluateModelRequest request;
  request.set_frame(v1::PIXEL_FRAME_PHOTOGRAPH);
  request.mutable_options()->set_protocol(protocol);
  const bool spin = benchmark == Benchmark::kSpinNerf;
  request.mutable_options()->set_score_reference(spin);
  request.mutable_options()->set_accept_trained_views(spin || benchmark == Benchmark::kNvos);
  RequestViews added(views, request);
  for (const TruthFile& file : scene.truth) {
    ASSIGN_OR_RETURN(v1::ViewTruth * truth, added.Truth(file.view));
    ASSIGN_OR_RETURN(const GreyPicture mask, MaskOf(file.mask, added.Size(file.view)));
    v1::EntityMask& entity = *truth->add_masks();
    entity.set_entity(file.entity);
    entity.mutable_mask()->set_png(EncodePng(mask));
  }
  for (const ReferencePrompt& prompt : scene.prompts) {
    RETURN_IF_ERROR(AddPrompt(prompt, added, request));
  }
  return request;
}

absl::StatusOr<std::vector<v1::EvaluateModelRequest>> SamRequests(
    const BenchmarkScene& scene, const std::vector<v1::View>& views) {
  TruthFlags masks;
  masks.folder = scene.folder / "masks";
  std::vector<v1::EvaluateModelRequest> requests;
  for (const v1::View& view : views) {
    std::error_code error;
    const fs::path file = masks.folder / fs::path(view.view()).replace_extension(".json");
    if (!view.held_out() || !fs::exists(file, error)) continue;
    v1::EvaluateModelRequest request;
    request.set_frame(v1::PIXEL_FRAME_PHOTOGRAPH);
    request.mutable_options()->set_protocol(v1::EVALUATION_PROTOCOL_SAM_AGREEMENT);
    RETURN_IF_ERROR(AddSamMasks(masks, {view}, request).status());
    const auto& given = request.sam_views(0).masks();
    const bool scored = std::any_of(given.begin(), given.end(),
                                    [](const auto& mask) { return mask.has_predicted_iou(); });
    // Masks of something else may have SAM's format; those have no scores.
    if (scored) requests.push_back(std::move(request));
  }
  return requests;
}

}  // namespace pepeseg::client::cli
