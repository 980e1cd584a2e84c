#include "clients/cli/labelled_masks.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cpp/answer_status.h"
#include "clients/cpp/mask.h"
#include "clients/cpp/nearest_names.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/progress_line.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/view_picture.h"

namespace pepeseg::client::cli {
namespace {

// Views of a request: its answer stays far below 4 MiB, and its time below the deadline with SAM.
constexpr size_t kViewsAtOnce = 8;

std::string LabelIdOf(const std::string& name) { return name.substr(name.rfind('/') + 1); }

// Returns the views that are asked for, in the order of the model. INVALID_ARGUMENT: one is
// unknown, or none is held out.
absl::StatusOr<std::vector<v1::View>> ChosenViews(const Client& client, const LabelQuery& query) {
  ASSIGN_OR_RETURN(const std::vector<v1::View> all, client.ListViews(query.model));
  std::set<std::string> wanted(query.views.begin(), query.views.end());
  if (wanted.empty() || wanted.erase("all") > 0) return all;
  const bool held_out = wanted.erase("held-out") > 0;
  std::vector<v1::View> chosen;
  std::vector<std::string> names;
  for (const v1::View& view : all) {
    names.push_back(view.view());
    if (wanted.erase(view.view()) > 0 || (held_out && view.held_out())) chosen.push_back(view);
  }
  if (!wanted.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("--views ", *wanted.begin(), ": no view of ", query.model,
                     DidYouMean(NearestNames(*wanted.begin(), names))));
  }
  if (chosen.empty()) return absl::InvalidArgumentError("the model has no held-out view");
  return chosen;
}

// Appends the mask of the label in each view to the masks of the view.
absl::Status AddMasks(const Client& client, const LabelQuery& query, const std::string& label,
                      std::span<LabelledView> views) {
  v1::SegmentViewsRequest request;
  request.set_model(query.model);
  request.mutable_prompt()->set_label(label);
  for (const LabelledView& view : views) request.mutable_targets()->add_views(view.view);
  request.set_mask_encoding(v1::MASK_ENCODING_COCO_RLE);
  if (!query.sam_borders) request.set_sam_borders(false);
  ASSIGN_OR_RETURN(v1::SegmentViewsResponse answer, client.Segment(request));
  RETURN_IF_ERROR(TakeAcceptedMask(client, request, answer));
  if (answer.masks_size() != static_cast<int>(views.size())) {
    return absl::InternalError("the server's answer lacks a mask");
  }
  for (size_t i = 0; i < views.size(); ++i) views[i].masks.push_back(answer.masks(i).rle());
  return absl::OkStatus();
}

}  // namespace

std::vector<LabelledThing> ThingsOf(const std::vector<v1::Label>& labels) {
  std::vector<LabelledThing> things;
  std::map<std::string, std::set<int64_t>> taken;  // numbers by category
  for (const v1::Label& label : labels) {
    LabelledThing thing{LabelIdOf(label.name()), label.view(), label.text(), label.text()};
    if (thing.text.empty()) thing.category = thing.text = thing.id;
    thing.track = static_cast<int64_t>(things.size()) + 1;
    const size_t dot = thing.text.rfind('.');
    int64_t number = 0;
    if (dot != std::string::npos && dot > 0 &&
        absl::SimpleAtoi(thing.text.substr(dot + 1), &number) && number > 0) {
      const std::string category = thing.text.substr(0, dot);
      if (taken[category].insert(number).second) {
        thing.category = category;
        thing.instance = number;
      }
    }
    things.push_back(std::move(thing));
  }
  for (LabelledThing& thing : things) {
    std::set<int64_t>& numbers = taken[thing.category];
    for (int64_t number = 1; thing.instance == 0; ++number) {
      if (numbers.insert(number).second) thing.instance = number;
    }
  }
  return things;
}

absl::Status TakeAcceptedMask(const Client& client, const v1::SegmentViewsRequest& request,
                              v1::SegmentViewsResponse& answer) {
  const v1::Granularity& granularity = request.granularity();
  if (request.prompt().label().empty() || granularity.has_threshold() ||
      granularity.scale_case() != v1::Granularity::SCALE_NOT_SET) {
    return absl::OkStatus();
  }
  std::string scene = SceneOf(request.model());
  if (scene.empty()) scene = SceneOf(answer.model());  // a job was named
  if (scene.empty()) return absl::OkStatus();
  const std::string name = absl::StrCat(scene, "/labels/", LabelIdOf(request.prompt().label()));
  ASSIGN_OR_RETURN(const v1::Label label, client.GetLabel(name, request.frame()));
  for (v1::SegmentViewsResponse::ViewMask& found : *answer.mutable_masks()) {
    if (found.view() != label.view()) continue;
    const v1::CocoRle& rle = label.mask().rle();
    ASSIGN_OR_RETURN(const Mask mask, DecodeRle(rle));
    const MaskExtent extent = ExtentOf(mask, {rle.width(), rle.height()});
    *found.mutable_rle() = rle;
    found.set_area(extent.area);
    found.mutable_box()->set_x(extent.x);
    found.mutable_box()->set_y(extent.y);
    found.mutable_box()->set_width(extent.width);
    found.mutable_box()->set_height(extent.height);
    found.clear_border_image();
  }
  return absl::OkStatus();
}

// Goes through the views outside and the labels inside, since SAM reads a view once.
absl::StatusOr<LabelledMasks> SegmentLabels(const Client& client, const LabelQuery& query) {
  ASSIGN_OR_RETURN(const auto labels, client.ListLabels(query.scene));
  if (labels.labels().empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(SceneName(query.scene),
                     " has no label to export; name things with `pepeseg label`, or in the app"));
  }
  LabelledMasks masks{
      SceneName(query.scene), ThingsOf({labels.labels().begin(), labels.labels().end()}), {}};
  ASSIGN_OR_RETURN(const std::vector<v1::View> views, ChosenViews(client, query));
  for (const v1::View& view : views) {
    masks.views.push_back({view.view(), PhotographSize(view), {}});
  }
  ProgressLine line;
  const size_t num_masks = masks.views.size() * masks.things.size();
  size_t num_done = 0;
  for (size_t first = 0; first < masks.views.size(); first += kViewsAtOnce) {
    const size_t count = std::min(kViewsAtOnce, masks.views.size() - first);
    for (const LabelledThing& thing : masks.things) {
      RETURN_IF_ERROR(
          AddMasks(client, query, thing.id, std::span(masks.views).subspan(first, count)));
      num_done += count;
      line.Show(absl::StrFormat("%d of %d masks", num_done, num_masks), num_done == num_masks);
    }
  }
  return masks;
}

MaskExtent ExtentOf(const std::vector<uint8_t>& mask, const PixelSize& size) {
  MaskExtent extent{0, size.width, size.height, 0, 0};
  int right = 0, bottom = 0;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      if (mask[static_cast<size_t>(y) * size.width + x] == 0) continue;
      ++extent.area;
      extent.x = std::min(extent.x, x), extent.y = std::min(extent.y, y);
      right = std::max(right, x + 1), bottom = std::max(bottom, y + 1);
    }
  }
  if (extent.area == 0) return {};
  extent.width = right - extent.x, extent.height = bottom - extent.y;
  return extent;
}

}  // namespace pepeseg::client::cli
