#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "core/scene/mask_set.h"
#include "core/scene/model.h"

namespace pepeseg {

// Limits of views and prompts, which the checks below enforce. The contract documents them.
inline constexpr int kMaxViewSide = 16'384;
inline constexpr int64_t kMaxViewPixels = 64'000'000;
inline constexpr int64_t kMaxFreePixels = 16'000'000;  // of a free camera, which anybody may send
inline constexpr double kMaxNormError = 1e-3;          // of a quaternion: decimals, floats
// Each point takes a part of the time of a query.
inline constexpr size_t kMaxPromptPoints = 64;
inline constexpr int kMaxTargets = 1000;       // views of a request
inline constexpr int kMaxProposals = 16;       // each has a mask in the answer
inline constexpr int kMaxVotingViews = 100;    // of a selection, each rendered and segmented
inline constexpr int kMaxMaskBytes = 4 << 20;  // of a PNG, before it is decoded
// Limits of the strokes of one prompt.
inline constexpr size_t kMaxVertices = 4096;
inline constexpr double kMaxStrokeWidth = 256;    // pixels
inline constexpr double kMaxStrokePixels = 16e6;  // length times width of all

struct PointPrompt {
  double x = 0, y = 0;  // pixels of the prompt's image, in [0, width) x [0, height)
  bool positive = true;
};
// At least one is positive.
using PointsPrompt = std::vector<PointPrompt>;

// Stands for the thing that fills the box.
struct BoxPrompt {
  double x = 0, y = 0, width = 0, height = 0;  // pixels of the prompt's image, which it overlaps
};

// A line drawn by hand: through `path`, pixels of the prompt's image.
struct Stroke {
  std::vector<Eigen::Vector2d> path;  // at least one; a single one is a dot
  bool positive = true;
  double width = 0;  // pixels; 0: as thin as the view can show
};
// Strokes of any number of pixels, each mask of the size of the prompt's image: Frame::Draw.
struct Scribbles {
  BinaryMask positive;
  BinaryMask negative;  // without pixels: no negative strokes
};

// The mean feature of these points, which are all positive.
struct PointMean {
  PointsPrompt points;
};

// A mask has the size of the prompt's image and at least one pixel. A kind that is added here does
// not compile until each std::visit answers it.
using Shape = std::variant<PointsPrompt, BoxPrompt, BinaryMask, Scribbles, PointMean>;
// Returns the mask, or the positive strokes, of a shape; null: it has points or a box.
const BinaryMask* MaskOf(const Shape& shape);
// Returns the points of a shape; null: it has none.
const PointsPrompt* PointsOf(const Shape& shape);
// Makes one visitor from a function for each kind.
template <class... Kinds>
struct Overloaded : Kinds... {
  using Kinds::operator()...;
};
template <class... Kinds>
Overloaded(Kinds...) -> Overloaded<Kinds...>;

// A shape in a view, which stands for a thing to segment. In pixels of the view, unless it is read
// for a Frame.
struct Prompt {
  ModelView view;
  Shape what;
  // The answer to all points but the last, which then corrects this mask. Absent: all points are
  // answered, one after the other. Only points may have one.
  std::optional<BinaryMask> previous = {};
};

// The size of the thing that is meant, and how similar its pixels are. Absent values are chosen.
struct Granularity {
  std::optional<double> scale = {};      // quantile, [0, 1]
  std::optional<double> threshold = {};  // cosine, [-1, 1]
};

// A query that gives a mask in any view. A pixel is inside if its best similarity to a positive
// feature exceeds the threshold and its best similarity to a negative feature.
struct Query {
  std::vector<float> features;    // [num, 32] as rendered, not gated
  std::vector<uint8_t> positive;  // [num] 0 or 1, at least one of them 1
  double scale = 0.5;             // quantile, [0, 1]
  double threshold = 0.75;        // cosine, [-1, 1]
};

// The image that a prompt is drawn in: a view, or its photograph (Frame).
struct PromptImage {
  std::string name;  // for messages: view "a.jpg", photograph "a.jpg", the free camera
  int width = 0, height = 0;

  // Returns the size in pixels as text: "640x480".
  std::string Size() const;
};
PromptImage ImageOf(const ModelView& view);

// An invalid part of a prompt, a view or a granularity, as the payload of a status.
struct PromptFault {
  std::string part;  // "points[3]", "camera.fx", "threshold"; empty: the whole
  // The value and the rule that it breaks: "point 7,5" and "is outside ...", or "7" and
  // "not in [0, 1]". No value: "" and "is required".
  std::string value, limit;

  bool is_number() const { return !value.empty() && value.find(' ') == std::string::npos; }
};
// Returns INVALID_ARGUMENT with the fault.
absl::Status FaultError(const PromptFault& fault);
// Returns the fault of an error, or nothing if it has none.
std::optional<PromptFault> FaultOf(const absl::Status& status);

// The checks. Each returns the error of a fault unless its argument is valid.
//
// A view without a name is a free camera, of at most kMaxFreePixels.
absl::Status CheckCamera(const ModelView& view);
absl::Status CheckView(const ModelView& view);
absl::Status CheckGranularity(const Granularity& granularity);
absl::Status CheckScale(double scale);
absl::Status CheckThreshold(double threshold);
// scale_units: in scene units, > 0.
absl::Status CheckScaleUnits(double scale_units);
// The numbers in requests. 0: the default.
absl::Status CheckNumTargets(int num_targets);
absl::Status CheckNumProposals(int num_proposals);
absl::Status CheckNumVoting(int num_views);
absl::Status CheckMaskBytes(size_t num_bytes);
// Refuses points outside the image, and points of which none is positive. With a mask that the last
// of them corrects, all may be negative.
absl::Status CheckPoints(const PromptImage& image, std::span<const PointPrompt> points,
                         bool has_previous = false);
absl::Status CheckBox(const PromptImage& image, const BoxPrompt& box);
absl::Status CheckMask(const PromptImage& image, const BinaryMask& mask);
absl::Status CheckStrokes(const PromptImage& image, std::span<const Stroke> strokes);
// Check what a user gives: also refuse more than kMaxPromptPoints.
absl::Status CheckShape(const PromptImage& image, const Shape& shape);
absl::Status CheckShown(  // also the previous mask
    const PromptImage& image, const Prompt& prompt);
// Refuses a mask without a pixel.
absl::Status CheckNotEmpty(const BinaryMask& mask);
absl::Status CheckQuery(const Query& query);

// Returns INVALID_ARGUMENT for a valid prompt where the model shows no Gaussian with a feature, as
// in the background or where no mask covered anything in training. IsNothingThere distinguishes it
// from other errors by a payload of the status.
absl::Status NothingThereError(absl::string_view message);
absl::Status NothingThereError(const PromptFault& fault);
bool IsNothingThere(const absl::Status& status);

}  // namespace pepeseg
