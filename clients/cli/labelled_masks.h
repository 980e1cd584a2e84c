#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cpp/client.h"
#include "clients/terminal/picture.h"
#include "pepeseg/v1/label_service.pb.h"
#include "pepeseg/v1/prompt.pb.h"
#include "pepeseg/v1/segmentation_service.pb.h"

// Masks of a scene's labels in the views of a model, for the export to annotation tools.
namespace pepeseg::client::cli {

// A labelled thing, the same in all views.
struct LabelledThing {
  std::string id;        // of the label
  std::string view;      // of the label
  std::string text;      // of the label
  std::string category;  // text without its number: "mug" of "mug.2"
  int64_t instance = 0;  // number of the thing in its category: 2 of "mug.2"
  int64_t track = 0;     // number of the thing in the scene, from 1
};

// Returns the labels as things, in their order. A text NAME.NUMBER with a number > 0 that no
// earlier label of the category has gives category and instance; other labels get the lowest free
// numbers of their category.
std::vector<LabelledThing> ThingsOf(const std::vector<v1::Label>& labels);

struct LabelledView {
  std::string view;
  PixelSize size;                  // of the photograph
  std::vector<v1::CocoRle> masks;  // one for each thing
};

struct LabelledMasks {
  std::string scene;  // resource name
  std::vector<LabelledThing> things;
  std::vector<LabelledView> views;
};

struct LabelQuery {
  std::string scene;               // id or resource name
  std::string model;               // resource name
  std::vector<std::string> views;  // names, "all" or "held-out"; empty: all
  bool sam_borders = true;         // let SAM place the borders where it suits the model
};

// Segments every label in every view of the query, in the pixels of the photographs. In the view
// of a label the mask is the label's own. INVALID_ARGUMENT: the scene has no label, or the model
// not a view of that name.
absl::StatusOr<LabelledMasks> SegmentLabels(const Client& client, const LabelQuery& query);

// Replaces the mask in the label's own view by the mask that was accepted, if the request is of a
// label without granularity and `answer` has that view.
absl::Status TakeAcceptedMask(const Client& client, const v1::SegmentViewsRequest& request,
                              v1::SegmentViewsResponse& answer);

// Returns the number of pixels of a mask, 0 or 1 each, and the smallest box around them.
struct MaskExtent {
  int64_t area = 0;
  int x = 0, y = 0, width = 0, height = 0;
};
MaskExtent ExtentOf(const std::vector<uint8_t>& mask, const PixelSize& size);

}  // namespace pepeseg::client::cli
