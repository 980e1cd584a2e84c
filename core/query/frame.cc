#include "core/query/frame.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

using Eigen::Vector2d;

constexpr double kRounding = 1e-6;  // pixels, tolerance of positions

// Returns the pinhole pixel that `lens` projects to `place`, by Newton's method from `start`, or
// nothing if the iteration leaves the region where the lens is invertible.
std::optional<Vector2d> InvertLens(const Lens& lens, const Vector2d& place, const Vector2d& start) {
  constexpr int kMaxIterations = 40;
  constexpr double kStep = 1e-3;  // pixels, step of the difference quotients
  constexpr double kSingular = 1e-9;
  const auto project = [&lens](const Vector2d& pixel) {
    return lens.Project(lens.PinholeRay(pixel));
  };
  const double longest_move = 0.5 * std::max(lens.width, lens.height);
  Vector2d pixel = start;
  for (int i = 0; i < kMaxIterations; ++i) {
    const Vector2d at = project(pixel);
    const Vector2d error = at - place;
    if (!error.allFinite()) return std::nullopt;
    if (error.norm() < kRounding) return pixel;
    Eigen::Matrix2d jacobian;
    jacobian.col(0) = (project(pixel + Vector2d(kStep, 0)) - at) / kStep;
    jacobian.col(1) = (project(pixel + Vector2d(0, kStep)) - at) / kStep;
    // The distortion folds over: outside the field of view for which the lens was calibrated.
    if (!(jacobian.determinant() > kSingular)) return std::nullopt;
    Vector2d move = jacobian.inverse() * error;
    if (move.norm() > longest_move) move *= longest_move / move.norm();
    pixel -= move;
  }
  return std::nullopt;
}

// The bounding box of positions that are added one by one.
class Bounds {
 public:
  void Add(const Vector2d& place) {
    low_ = low_.cwiseMin(place);
    high_ = high_.cwiseMax(place);
  }
  std::optional<BoxPrompt> box() const {
    if (!((high_ - low_).minCoeff() > 0)) return std::nullopt;
    return BoxPrompt{low_.x(), low_.y(), high_.x() - low_.x(), high_.y() - low_.y()};
  }

 private:
  Vector2d low_ = Vector2d::Constant(std::numeric_limits<double>::infinity());
  Vector2d high_ = -low_;
};

// Calls `use` with positions along the four sides of a rectangle, including its corners.
template <class Use>
void WalkAround(const Vector2d& low, const Vector2d& high, Use use) {
  constexpr int kNumSteps = 64;
  for (int i = 0; i <= kNumSteps; ++i) {
    const double share = static_cast<double>(i) / kNumSteps;
    const Vector2d along = low + share * (high - low);
    use(Vector2d(along.x(), low.y()));
    use(Vector2d(along.x(), high.y()));
    use(Vector2d(low.x(), along.y()));
    use(Vector2d(high.x(), along.y()));
  }
}

bool IsWithin(const Vector2d& place, const Vector2d& low, const Vector2d& high) {
  return ((place - low).array() >= -kRounding).all() &&
         ((high - place).array() >= -kRounding).all();
}

int NearestPixel(float place, int size) {
  return std::clamp(static_cast<int>(std::floor(place)), 0, size - 1);
}

}  // namespace

Frame::Frame(const ModelView& view, FrameKind kind) : image_(ImageOf(view)), camera_(view.camera) {
  if (kind == FrameKind::kPhotograph) photograph_ = view.photograph;
  if (kind == FrameKind::kPhotograph && !view.name.empty()) {
    image_.name = absl::StrCat("photograph \"", view.name, "\"");
  }
  if (photograph_) {
    image_.width = photograph_->UprightWidth();
    image_.height = photograph_->UprightHeight();
  }
  is_view_ = is_shrunk() && width() == camera_.width && height() == camera_.height;
  ResizeTo(width(), height());
}

Frame Frame::Resized(const ImageSize& size) const {
  ModelView view;
  view.camera = {static_cast<int>(size.width), static_cast<int>(size.height)};
  Frame resized(view, FrameKind::kView);
  resized.image_.name = image_.name;
  return resized;
}

bool Frame::MapsAs(const Frame& other) const {
  return camera_ == other.camera_ && photograph_ == other.photograph_;
}

void Frame::AcceptStored(int orientation, bool is_stored) {
  orientation_ = orientation;
  is_stored_ = is_stored;
}

bool Frame::FitsStored(int64_t width, int64_t height) const {
  constexpr int kFirstTransposed = 5;  // EXIF orientations from here on exchange the sides
  if (orientation_ == 1) return false;
  return orientation_ < kFirstTransposed ? width == image_.width && height == image_.height
                                         : width == image_.height && height == image_.width;
}

int Frame::TurnOf(int64_t width, int64_t height) const {
  const bool fits_frame = width == image_.width && height == image_.height;
  return FitsStored(width, height) && (is_stored_ || !fits_frame) ? orientation_ : 1;
}

// The click was valid, but the model cannot know what is there.
absl::Status Frame::NotShown(const std::string& part, const std::string& value) const {
  return NothingThereError(
      {part, value,
       absl::StrCat("is in a part of ", image_.name, " (", image_.Size(),
                    ") that the model was not trained on: its lens was undistorted and the border "
                    "cut off")});
}

absl::StatusOr<Shape> Frame::Take(const PointsPrompt& points) const {
  PointsPrompt taken = points;
  for (size_t i = 0; i < taken.size(); ++i) {
    const std::optional<Vector2d> in_view = ToView(Vector2d(taken[i].x, taken[i].y));
    if (!in_view) {
      return NotShown(absl::StrCat("points[", i, "]"),
                      absl::StrCat("point ", taken[i].x, ",", taken[i].y));
    }
    taken[i].x = in_view->x();
    taken[i].y = in_view->y();
  }
  return taken;
}

absl::StatusOr<Shape> Frame::Take(const BoxPrompt& box) const {
  const std::optional<BoxPrompt> in_view = ToView(box);
  if (in_view) return *in_view;
  return NotShown("", absl::StrCat("box ", box.x, ",", box.y, " ", box.width, "x", box.height));
}

absl::StatusOr<BinaryMask> Frame::TakeMask(const BinaryMask& mask) const {
  BinaryMask taken;
  for (const int32_t pixel : PixelsOfView()) taken.pixels.push_back(mask.pixels[pixel]);
  if (CheckNotEmpty(taken).ok()) return taken;
  return FaultError({"", "",
                     absl::StrCat("no pixel of the mask is in the part of ", image_.name,
                                  " that the model was trained on, or the mask is too small for "
                                  "it")});
}

absl::StatusOr<Shape> Frame::Take(const PointMean& mean) const {
  ASSIGN_OR_RETURN(Shape taken, Take(mean.points));
  return PointMean{std::get<PointsPrompt>(std::move(taken))};
}

absl::StatusOr<Prompt> Frame::ToView(Prompt prompt) const {
  RETURN_IF_ERROR(CheckShown(image_, prompt));
  // The pixels of a prompt stay exactly as they are.
  if (is_view_) return prompt;
  ASSIGN_OR_RETURN(prompt.what,
                   std::visit([this](const auto& shape) { return Take(shape); }, prompt.what));
  if (!prompt.previous) return prompt;
  ASSIGN_OR_RETURN(prompt.previous, TakeMask(*prompt.previous));
  return prompt;
}

Vector2d Frame::PinholePixel(const Vector2d& place) const {
  return {photograph_->left + place.x() * photograph_->width / camera_.width,
          photograph_->top + place.y() * photograph_->height / camera_.height};
}

Vector2d Frame::PlaceOfPinholePixel(const Vector2d& pixel) const {
  return {(pixel.x() - photograph_->left) * camera_.width / photograph_->width,
          (pixel.y() - photograph_->top) * camera_.height / photograph_->height};
}

Vector2d Frame::FromView(const Vector2d& place) const {
  if (is_view_) return place;
  const Vector2d pixel = PinholePixel(place);
  const Lens& lens = photograph_->lens;
  return photograph_->ToUpright(is_straight() ? pixel : lens.Project(lens.PinholeRay(pixel)));
}

std::optional<Vector2d> Frame::Invert(const Vector2d& place, const Vector2d* near) const {
  if (is_view_) return place;
  const Vector2d stored = photograph_->ToStored(place);
  if (is_straight()) return PlaceOfPinholePixel(stored);
  std::optional<Vector2d> pixel;
  if (near != nullptr) pixel = InvertLens(photograph_->lens, stored, PinholePixel(*near));
  if (!pixel) {
    // Start inside the view, where the distortion does not fold.
    const Vector2d low(photograph_->left, photograph_->top);
    const Vector2d high = low + Vector2d(photograph_->width, photograph_->height);
    pixel = InvertLens(photograph_->lens, stored, stored.cwiseMax(low).cwiseMin(high));
  }
  if (!pixel) return std::nullopt;
  return PlaceOfPinholePixel(*pixel);
}

std::optional<Vector2d> Frame::ToView(const Vector2d& place) const {
  const std::optional<Vector2d> found = Invert(place);
  const Vector2d size(camera_.width, camera_.height);
  if (!found || !IsWithin(*found, Vector2d::Zero(), size)) return std::nullopt;
  const Vector2d last(std::nextafter(size.x(), 0), std::nextafter(size.y(), 0));
  return found->cwiseMax(Vector2d::Zero()).cwiseMin(last);
}

// The visible part of the box is bounded by sides of the box inside the view and sides of the view
// inside the box.
std::optional<BoxPrompt> Frame::ToView(const BoxPrompt& box) const {
  const Vector2d low = Vector2d(box.x, box.y).cwiseMax(0);
  const Vector2d high =
      Vector2d(box.x + box.width, box.y + box.height).cwiseMin(Vector2d(width(), height()));
  if (!((high - low).minCoeff() > 0)) return std::nullopt;
  Bounds bounds;
  WalkAround(low, high, [&](const Vector2d& place) {
    if (const std::optional<Vector2d> in_view = ToView(place)) bounds.Add(*in_view);
  });
  const Vector2d size(camera_.width, camera_.height);
  WalkAround(Vector2d::Zero(), size, [&](const Vector2d& place) {
    if (IsWithin(FromView(place), low, high)) bounds.Add(place);
  });
  return bounds.box();
}

// Returns the pixel of the photograph at a pixel of the part that the view shows. Repeats the
// import's arithmetic, including its rounding to float, so that masks match exactly.
int32_t Frame::PixelAt(int part_x, int part_y) const {
  const Lens& lens = photograph_->lens;
  const Vector2d pixel(photograph_->left + part_x + 0.5, photograph_->top + part_y + 0.5);
  const Vector2d place = is_straight() ? pixel : lens.Project(lens.PinholeRay(pixel));
  const Vector2d stored(NearestPixel(static_cast<float>(place.x()), lens.width) + 0.5,
                        NearestPixel(static_cast<float>(place.y()), lens.height) + 0.5);
  const Vector2d upright = photograph_->ToUpright(stored);
  return static_cast<int32_t>(upright.y()) * width() + static_cast<int32_t>(upright.x());
}

std::vector<int32_t> Frame::PixelsOfView() const {
  std::vector<int32_t> pixels(static_cast<size_t>(camera_.width) * camera_.height);
  if (!photograph_) {
    std::iota(pixels.begin(), pixels.end(), 0);
    return pixels;
  }
  size_t pixel = 0;
  for (int y = 0; y < camera_.height; ++y) {
    const int64_t part_y = (2 * int64_t{y} + 1) * photograph_->height / (2 * camera_.height);
    for (int x = 0; x < camera_.width; ++x) {
      const int64_t part_x = (2 * int64_t{x} + 1) * photograph_->width / (2 * camera_.width);
      pixels[pixel++] = PixelAt(static_cast<int>(part_x), static_cast<int>(part_y));
    }
  }
  return pixels;
}

std::vector<uint8_t> Frame::TakeIgnoreToView(const std::vector<uint8_t>& ignore) const {
  if (is_view_) return ignore;
  std::vector<uint8_t> taken(static_cast<size_t>(camera_.width) * camera_.height, 0);
  // First and last of `to` pixels that pixel `at` of `from` overlaps, along one axis.
  const auto first = [](int64_t at, int from, int to) { return at * to / from; };
  const auto last = [](int64_t at, int from, int to) { return ((at + 1) * to - 1) / from; };
  const int part_width = photograph_->width, part_height = photograph_->height;
  for (int y = 0; y < part_height; ++y) {
    for (int x = 0; x < part_width; ++x) {
      if (ignore[PixelAt(x, y)] == 0) continue;
      for (auto v = first(y, part_height, camera_.height);
           v <= last(y, part_height, camera_.height); ++v) {
        for (auto u = first(x, part_width, camera_.width); u <= last(x, part_width, camera_.width);
             ++u) {
          taken[v * camera_.width + u] = 1;
        }
      }
    }
  }
  return taken;
}

}  // namespace pepeseg
