#include "server/services/labelled_views.h"

#include <algorithm>
#include <iterator>
#include <optional>
#include <set>
#include <utility>
#include <variant>

#include "absl/memory/memory.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/formats/rle.h"
#include "server/api/error.h"
#include "server/api/resource_name.h"
#include "server/api/segment_request.h"

namespace pepeseg {
namespace {

// Views of one label that are segmented before the next label: as many as SAM places masks in by
// default. SAM reads a view once for all labels.
constexpr size_t kViewsAtOnce = 8;

// Returns the name of a request with the number of the model in place of "live", so that all
// answers are of one model.
std::string WithNumber(const std::string& name, const ResidentModel& model) {
  if (!absl::EndsWith(name, "/live")) return name;
  return absl::StrCat(name.substr(0, name.rfind('/') + 1), model.id.number);
}

}  // namespace

absl::StatusOr<std::vector<LabelRecord>> AllLabels(const SceneRef& scene, Store& store) {
  std::vector<LabelRecord> all;
  PageRequest page{1000, ""};
  do {
    ASSIGN_OR_RETURN(Page<LabelRecord> labels, store.labels().ListLabels(scene, page));
    std::ranges::move(labels.records, std::back_inserter(all));
    page.page_token = labels.next_page_token;
  } while (!page.page_token.empty());
  return all;
}

absl::StatusOr<std::unique_ptr<AnnotatedViews>> LabelledViews::Begin(
    const SegmentTools& tools, QueryCall call, const v1::ExportAnnotationsRequest& request) {
  auto views = absl::WrapUnique(new LabelledViews(tools, std::move(call), request));
  ASSIGN_OR_RETURN(views->model_,
                   tools.models.LoadWithFeatures(views->call_.scenes, request.model(), "model"));
  RETURN_IF_ERROR(views->ReadLabels());
  RETURN_IF_ERROR(views->ReadViews(request));
  return views;
}

absl::Status LabelledViews::ReadLabels() {
  const SceneRef& scene = model_.id.scene;
  ASSIGN_OR_RETURN(std::vector<LabelRecord> all, AllLabels(scene, tools_.store));
  scene_.name = SceneName(scene);
  if (all.empty()) {
    return WithResource(
        absl::FailedPreconditionError(absl::StrCat(
            scene_.name,
            " has no label to export; name things with `pepeseg label`, or in the app")),
        "NO_LABELS", scene_.name);
  }
  std::vector<LabelText> texts;
  for (const LabelRecord& label : all) texts.push_back({label.id, label.text});
  std::vector<AnnotatedThing> things = ThingsOf(texts);
  std::set<std::string> wanted(request_.labels().begin(), request_.labels().end());
  for (size_t i = 0; i < all.size(); ++i) {
    if (!request_.labels().empty() && wanted.erase(all[i].id) == 0) continue;
    scene_.things.push_back(std::move(things[i]));
    labels_.push_back(std::move(all[i]));
  }
  if (wanted.empty()) return absl::OkStatus();
  const absl::Status missing = tools_.store.labels().GetLabel(scene, *wanted.begin()).status();
  return WithResource(missing.ok() ? absl::AbortedError("the labels have changed") : missing,
                      "NO_SUCH_LABEL", LabelName(scene, *wanted.begin()));
}

absl::Status LabelledViews::BeginAnswer() {
  const size_t count = std::min(kViewsAtOnce, scene_.views.size() - first_view_);
  if (thing_ == 0) {
    open_.clear();
    for (size_t i = 0; i < count; ++i) open_.push_back({first_view_ + i, {}, {}});
  }
  asked_.Clear();
  answered_.Clear();
  asked_.set_model(WithNumber(request_.model(), model_));
  asked_.mutable_prompt()->set_label(labels_[thing_].id);
  for (const AnnotatedView& view : open_) {
    asked_.mutable_targets()->add_views(scene_.views[view.index]);
  }
  if (request_.has_sam_borders()) asked_.set_sam_borders(request_.sam_borders());
  ASSIGN_OR_RETURN(answer_, SegmentAnswer::Begin(tools_, call_, asked_, &answered_));
  return absl::OkStatus();
}

absl::StatusOr<bool> LabelledViews::FindSome() {
  if (answer_ == nullptr) {
    RETURN_IF_ERROR(BeginAnswer());
    return false;
  }
  const std::optional<absl::Status> status = answer_->SegmentNext();
  if (!status) return false;
  answer_.reset();
  RETURN_IF_ERROR(*status);
  RETURN_IF_ERROR(TakeAnswer());
  return true;
}

absl::Status LabelledViews::TakeAnswer() {
  const LabelRecord& label = labels_[thing_];
  for (size_t i = 0; i < open_.size(); ++i) {
    AnnotatedView& view = open_[i];
    v1::CocoRle& rle = *answered_.mutable_masks(static_cast<int>(i))->mutable_rle();
    view.size = {rle.width(), rle.height()};
    view.counts.push_back(std::move(*rle.mutable_counts()));
    if (scene_.views[view.index] != label.view) continue;
    // The mask that was accepted.
    ASSIGN_OR_RETURN(const Prompt prompt, PromptOfLabel(label, model_->model(), model_.id));
    const Frame frame(prompt.view);
    view.counts.back() = EncodeCocoRle(frame.FromView(std::get<BinaryMask>(prompt.what)),
                                       frame.width(), frame.height());
  }
  num_done_ += static_cast<int64_t>(open_.size());
  if (++thing_ < labels_.size()) return absl::OkStatus();
  thing_ = 0;
  first_view_ += open_.size();
  std::ranges::move(open_, std::back_inserter(complete_));
  open_.clear();
  return absl::OkStatus();
}

absl::StatusOr<ThingGaussians> LabelledViews::GaussiansOf(size_t thing) const {
  ASSIGN_OR_RETURN(Prompt prompt, PromptOfLabel(labels_[thing], model_->model(), model_.id));
  SelectRequest request;
  request.prompt = std::move(prompt);
  ASSIGN_OR_RETURN(const GaussianSet set, model_->Select(request, call_.check));
  ThingGaussians found{set.count()};
  const SetBounds bounds = BoundsOf(model_->model().gaussians, set);
  for (int axis = 0; axis < 3 && !bounds.empty(); ++axis) {
    found.min[axis] = bounds.min[axis];
    found.max[axis] = bounds.max[axis];
  }
  return found;
}

}  // namespace pepeseg
