#include "server/services/segmented_level.h"

#include <algorithm>
#include <map>
#include <utility>
#include <variant>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"
#include "core/annotations/id_counts.h"
#include "core/base/status_macros.h"
#include "server/api/decomposition.h"
#include "server/api/error.h"
#include "server/api/segment_request.h"
#include "server/services/labelled_views.h"

namespace pepeseg {
namespace {

constexpr double kLeastIou = 0.5;  // of a segment and the label that names it

absl::Status CheckAlone(const v1::ExportAnnotationsRequest& request) {
  if (!request.labels().empty()) {
    return BadField("labels", absl::StrCat(request.labels_size()), "labels next to segments");
  }
  if (request.has_sam_borders()) {
    return BadField("sam_borders", "", "the masks of segments do not overlap, so SAM places none");
  }
  return absl::OkStatus();
}

// Returns the id with the greatest IoU with a mask of the same size; 0: none has kLeastIou.
int32_t BestId(const std::vector<int32_t>& ids, const BinaryMask& mask) {
  if (ids.size() != mask.pixels.size()) return 0;
  std::map<int32_t, std::pair<int64_t, int64_t>> counts;  // pixels, and those in the mask
  int64_t area = 0;
  for (size_t i = 0; i < ids.size(); ++i) {
    const bool inside = mask.pixels[i] != 0;
    area += inside ? 1 : 0;
    if (ids[i] == 0) continue;
    auto& [all, common] = counts[ids[i]];
    ++all;
    common += inside ? 1 : 0;
  }
  int32_t best = 0;
  double best_iou = 0;
  for (const auto& [id, count] : counts) {
    const auto& [all, common] = count;
    const double iou = static_cast<double>(common) / static_cast<double>(area + all - common);
    if (iou >= kLeastIou && iou > best_iou) best = id, best_iou = iou;
  }
  return best;
}

}  // namespace

absl::StatusOr<std::unique_ptr<AnnotatedViews>> SegmentedLevel::Begin(
    const SegmentTools& tools, const QueryCall& call, const v1::ExportAnnotationsRequest& request) {
  RETURN_IF_ERROR(CheckAlone(request));
  auto views = absl::WrapUnique(new SegmentedLevel());
  ASSIGN_OR_RETURN(views->scales_, ReadScales(request.segments().scales(), "segments.scales"));
  views->level_ = request.segments().level();
  RETURN_IF_ERROR(CheckLevelField(views->level_, views->scales_.size(), "segments.level"));
  ASSIGN_OR_RETURN(views->model_,
                   tools.models.LoadWithFeatures(call.scenes, request.model(), "model"));
  RETURN_IF_ERROR(views->ReadViews(request));
  RETURN_IF_ERROR(call.check());
  RETURN_IF_ERROR(views->Decompose());
  ASSIGN_OR_RETURN(const std::vector<std::string> names,
                   views->NamesOfSegments(tools.store, call.check));
  std::vector<LabelText> texts;
  for (size_t i = 0; i < names.size(); ++i) {
    texts.push_back({absl::StrCat(views->level_, "-", i + 1), names[i]});
  }
  views->scene_.name = SceneName(views->model_.id.scene);
  views->scene_.things = ThingsOf(texts);
  views->scene_.are_segments = true;
  return views;
}

absl::Status SegmentedLevel::Decompose() {
  return model_->Decompose(scales_, [this](const Decomposition& whole) {
    segments_ = whole.levels[static_cast<size_t>(level_)].segments;
    return absl::OkStatus();
  });
}

absl::StatusOr<RenderedView> SegmentedLevel::Render(const ModelView& view, FrameKind frame) const {
  RenderRequest request;
  request.view = view;
  request.frame = frame;
  request.content = RenderContent::kSegments;
  request.scales = scales_;
  request.level = level_;
  return model_->Render(request);
}

absl::StatusOr<std::vector<std::string>> SegmentedLevel::NamesOfSegments(
    Store& store, const WantedCheck& check) const {
  std::vector<std::string> names(segments_.size());
  ASSIGN_OR_RETURN(const std::vector<LabelRecord> labels, AllLabels(model_.id.scene, store));
  for (const LabelRecord& label : labels) {
    RETURN_IF_ERROR(check());
    const absl::StatusOr<Prompt> prompt = PromptOfLabel(label, model_->model(), model_.id);
    if (!prompt.ok()) continue;  // the model does not have the label's view
    ASSIGN_OR_RETURN(const RenderedView rendered, Render(prompt->view, FrameKind::kView));
    const int32_t id = BestId(rendered.ids, std::get<BinaryMask>(prompt->what));
    if (id == 0) continue;
    std::string& name = names[static_cast<size_t>(id) - 1];
    // The first label of a segment names it.
    if (name.empty()) name = label.text.empty() ? label.id : label.text;
  }
  for (std::string& name : names) {
    if (name.empty()) name = "segment";
  }
  return names;
}

absl::StatusOr<bool> SegmentedLevel::FindSome() {
  ASSIGN_OR_RETURN(const ModelView view,
                   FindView(scene_.views[next_view_], model_->model(), "targets"));
  ASSIGN_OR_RETURN(const RenderedView rendered, Render(view, FrameKind::kPhotograph));
  const RasterSize size{static_cast<int>(rendered.size.width),
                        static_cast<int>(rendered.size.height)};
  complete_.push_back({next_view_, size, CountsOfIds(rendered.ids, segments_.size(), size)});
  ++next_view_;
  num_done_ += static_cast<int64_t>(scene_.things.size());
  return true;
}

absl::StatusOr<ThingGaussians> SegmentedLevel::GaussiansOf(size_t thing) const {
  const Decomposition::Segment& segment = segments_[thing];
  ThingGaussians found{segment.num_gaussians};
  std::ranges::copy(segment.min, found.min.begin());
  std::ranges::copy(segment.max, found.max.begin());
  found.parent = segment.parent == 0 ? "" : absl::StrCat(level_ + 1, "-", segment.parent);
  return found;
}

}  // namespace pepeseg
