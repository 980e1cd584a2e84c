#include "clients/cli/benchmark_pictures.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "clients/cli/picture.h"
#include "clients/cli/view_picture.h"
#include "clients/cpp/mask.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

constexpr size_t kMaxPictures = 3;
constexpr Rgb kTruth{60, 255, 60};

using ScoredEntity = v1::EvaluateModelResponse::Entity;

// Returns the mask of an entity in a view of the request; null if it has none.
const v1::MaskImage* TruthMask(const v1::EvaluateModelRequest& request, const std::string& view,
                               const std::string& entity) {
  for (const v1::ViewTruth& truth : request.views()) {
    if (truth.view() != view) continue;
    for (const v1::EntityMask& mask : truth.masks()) {
      if (mask.entity() == entity) return &mask.mask();
    }
  }
  return nullptr;
}

// Returns the entity's prompt as SegmentViews takes it; nothing if it cannot.
std::optional<v1::Prompt> PromptOf(const v1::EvaluateModelRequest& request,
                                   const ScoredEntity& entity) {
  v1::Prompt prompt;
  prompt.mutable_view()->set_view(entity.reference_view());
  for (const v1::EntityPrompt& given : request.prompts()) {
    if (given.entity() != entity.name()) continue;
    if (given.has_mask()) *prompt.mutable_mask() = given.mask();
    if (given.has_scribbles()) *prompt.mutable_mask() = given.scribbles().positive();
    if (given.has_points()) *prompt.mutable_points() = given.points();
    if (given.has_box()) *prompt.mutable_box() = given.box();
    const v1::MaskImage* own = TruthMask(request, entity.reference_view(), entity.name());
    if (given.has_own_mask() && own != nullptr) *prompt.mutable_mask() = *own;
  }
  for (const auto& click : entity.clicks()) {
    auto& point = *prompt.mutable_points()->add_points();
    point.set_x(click.x());
    point.set_y(click.y());
    point.set_negative(click.negative());
  }
  if (prompt.what_case() == v1::Prompt::WHAT_NOT_SET) return std::nullopt;
  return prompt;
}

// Returns the scored view with the lowest IoU; "" if none is scored.
std::string WorstView(const ScoredEntity& entity) {
  const auto& scores = entity.automatic().views();
  if (scores.empty() || scores.size() != entity.views_size()) return "";
  const auto worst = std::min_element(
      scores.begin(), scores.end(), [](const auto& a, const auto& b) { return a.iou() < b.iou(); });
  return entity.views(static_cast<int>(worst - scores.begin())).view();
}

absl::Status DrawEntity(const Client& client, const v1::EvaluateModelRequest& request,
                        const ScoredEntity& entity, const std::filesystem::path& prefix) {
  const std::optional<v1::Prompt> prompt = PromptOf(request, entity);
  const std::string view = WorstView(entity);
  if (!prompt || view.empty()) return absl::OkStatus();
  v1::SegmentViewsRequest segment;
  segment.set_model(request.model());
  *segment.mutable_prompt() = *prompt;
  segment.mutable_targets()->add_views(view);
  const auto answer = client.Segment(segment);
  if (absl::IsFailedPrecondition(answer.status())) return absl::OkStatus();  // nothing is there
  RETURN_IF_ERROR(answer.status());
  const Overlay overlay{answer->masks(0), {}, v1::PIXEL_FRAME_PHOTOGRAPH};
  ASSIGN_OR_RETURN(Picture picture, DrawnOver(client, request.model(), overlay));
  if (const v1::MaskImage* truth = TruthMask(request, view, entity.name()); truth != nullptr) {
    ASSIGN_OR_RETURN(const Picture mask, DecodePicture(truth->png(), view));
    GreyPicture grey{mask.width, mask.height, {}};
    for (size_t i = 0; i < mask.pixels.size(); i += 3) grey.pixels.push_back(mask.pixels[i]);
    DrawOutline(picture, Resized(grey, picture.width, picture.height).pixels, kTruth);
  }
  return WritePng(
      absl::StrCat(prefix.string(), "-", Stem(entity.name() + ".png"), "-", Stem(view), ".png"),
      picture);
}

}  // namespace

absl::Status DrawWorst(const Client& client, const v1::EvaluateModelRequest& request,
                       const v1::EvaluateModelResponse& response,
                       const std::filesystem::path& prefix) {
  std::vector<const ScoredEntity*> entities;
  for (const ScoredEntity& entity : response.entities()) entities.push_back(&entity);
  std::stable_sort(entities.begin(), entities.end(),
                   [](const ScoredEntity* a, const ScoredEntity* b) {
                     return a->automatic().mean().iou() < b->automatic().mean().iou();
                   });
  for (size_t i = 0; i < std::min(entities.size(), kMaxPictures); ++i) {
    RETURN_IF_ERROR(DrawEntity(client, request, *entities[i], prefix));
  }
  return absl::OkStatus();
}

}  // namespace pepeseg::client::cli
