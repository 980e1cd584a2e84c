#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "core/query/view_features.h"
#include "core/scene/camera.h"
#include "core/scene/capture.h"
#include "core/scene/mask_set.h"
#include "core/scene/model.h"
#include "core/scene/photograph.h"

namespace pepeseg {

struct ImageSize {
  int64_t width = 0, height = 0;  // pixels

  bool operator==(const ImageSize&) const = default;
};
// Returns the mask at another size, by the nearest pixel.
BinaryMask Resized(const BinaryMask& mask, const ImageSize& from, const ImageSize& to);
// Returns the same view at another size in pixels.
ModelView AtSize(const ModelView& view, int width, int height);

// The image whose pixels a request and its answer use. A free camera always uses its own.
enum class FrameKind { kPhotograph, kView };

// Maps between the pixels of an uploaded photograph, upright, and of the view made from it.
//
// View to photograph uses the formulas of the import (ViewWarp): the part of the pinhole frame that
// the view shows, then the lens, then the EXIF orientation. Photograph to view inverts the lens by
// Newton's method. For kView, and for a view without a photograph, both have the same pixels.
// Positions count pixels, with pixel centres at + 0.5. For one thread at a time.
class Frame {
 public:
  explicit Frame(const ModelView& view, FrameKind kind = FrameKind::kPhotograph);

  // The upright photograph, with its size, or the view.
  const PromptImage& image() const { return image_; }
  int width() const { return image_.width; }
  int height() const { return image_.height; }
  const Camera& camera() const { return camera_; }
  // Returns whether photograph and view have the same pixels, so that no mapping is needed.
  bool is_view() const { return is_view_; }
  // Returns whether the lens has no distortion: the view is the photograph, rotated and scaled.
  bool is_straight() const { return !photograph_ || photograph_->lens.IsPinhole(); }
  // Returns whether the view is the photograph, possibly shrunk but not rotated.
  bool is_shrunk() const {
    return is_straight() && (!photograph_ || photograph_->orientation == 1);
  }
  // Returns the frame of an image of another size of the same view, which is the view's own.
  Frame Resized(const ImageSize& size) const;
  // Returns whether both map between equal photographs and cameras.
  bool MapsAs(const Frame& other) const;

  // Lets images of requests be of the pixels that are stored in the photograph's file, whose EXIF
  // orientation is in [1, 8] (core/dataset/pixel_frame.h). Those whose size fits both are of the
  // stored pixels if `is_stored`.
  void AcceptStored(int orientation, bool is_stored);
  // Returns whether an image of this size fits the stored pixels of a photograph that is turned.
  bool FitsStored(int64_t width, int64_t height) const;
  // Returns the EXIF orientation that turns an image of a request with this size upright; 1: it is
  // not turned.
  int TurnOf(int64_t width, int64_t height) const;

  // Draws strokes in pixels of image(), at least so wide that each has pixels in the view. Errors
  // are those of CheckStrokes.
  absl::StatusOr<Scribbles> Draw(std::span<const Stroke> strokes) const;  // fit_scribbles.cc
  // Returns a prompt in pixels of image() as one in pixels of the view. Errors are those of
  // CheckShown. Also refuses points, boxes and masks of which the view shows nothing; for points
  // and boxes that is a NothingThereError.
  absl::StatusOr<Prompt> ToView(Prompt prompt) const;

  // Returns the position in the photograph of a position in the view.
  Eigen::Vector2d FromView(const Eigen::Vector2d& place) const;
  // Returns the inverse of FromView, which may lie outside the view, or nothing if the search finds
  // no ray of the lens there. `near`, if not null, is a position in the view from which the search
  // starts.
  std::optional<Eigen::Vector2d> Invert(const Eigen::Vector2d& place,
                                        const Eigen::Vector2d* near = nullptr) const;
  // Returns the position in the view, or nothing if the view does not show it.
  std::optional<Eigen::Vector2d> ToView(const Eigen::Vector2d& place) const;
  // Returns the smallest box in the view around the visible part of a box of the photograph, or
  // nothing if no part is visible.
  std::optional<BoxPrompt> ToView(const BoxPrompt& box) const;

  // Returns the photograph's nearest pixel, y * width() + x, for each pixel of the view:
  // [height, width]. The import resamples masks in the same way.
  std::vector<int32_t> PixelsOfView() const;
  // Resamples an ignore mask: a pixel of the view is ignored if any part of it is, as in the
  // import.
  std::vector<uint8_t> TakeIgnoreToView(const std::vector<uint8_t>& ignore) const;

  // Sets the size of the images that the functions below return. Default: that of image().
  void ResizeTo(int width, int height);
  // These resample images of the view to the photograph. Pixels that the view does not show are 0.
  //
  // For a lens with distortion, positions in the view are computed exactly on a coarse grid of
  // pixels of the photograph and interpolated in between; the error is under 0.1 pixels for the
  // lenses of the tests. Next to the border of the visible part they are computed exactly. The grid
  // is computed once.
  //
  // Returns the mask in the photograph. A pixel is inside if the mask, smoothed over three pixels
  // of the view by a quadratic B-spline (which keeps straight edges in place), exceeds 0.5 there.
  // An enlarged mask thus does not show the steps of the view's pixels.
  BinaryMask FromView(const BinaryMask& mask) const;
  // Returns the result with mask, size, area, box and similarity (if there is one) in the
  // photograph. The score is 0 if the mask becomes empty; the other fields stay.
  SegmentResult FromView(SegmentResult result) const;
  // Resample bilinearly.
  Image FromView(const Image& image) const;
  std::vector<float> ValuesFromView(std::span<const float> values) const;
  // Resample to the nearest value.
  std::vector<float> NearestFromView(std::span<const float> values) const;
  std::vector<int32_t> NearestFromView(std::span<const int32_t> ids) const;

  // Writes the positions in the view, pixels, of the pixel centres of scanline y of the images
  // above. NaN: the view does not show the pixel. places.size() must be their width.
  void PlacesOfRow(int y, std::span<Eigen::Vector2f> places) const;

 private:
  // Positions in the view at the nodes of a grid over the photograph (frame_images.cc).
  struct Grid;

  int32_t PixelAt(int part_x, int part_y) const;
  Eigen::Vector2d PinholePixel(const Eigen::Vector2d& place) const;
  Eigen::Vector2d PlaceOfPinholePixel(const Eigen::Vector2d& pixel) const;
  absl::StatusOr<Shape> Take(const PointsPrompt& points) const;
  absl::StatusOr<Shape> Take(const BoxPrompt& box) const;
  absl::StatusOr<BinaryMask> TakeMask(const BinaryMask& mask) const;
  absl::StatusOr<Shape> Take(const BinaryMask& mask) const { return TakeMask(mask); }
  absl::StatusOr<Shape> Take(const Scribbles& scribbles) const;
  absl::StatusOr<Shape> Take(const PointMean& mean) const;
  absl::Status NotShown(const std::string& part, const std::string& value) const;

  Eigen::Vector2d InPhotograph(double x, double y) const;
  const Grid& MakeGrid() const;
  void StraightRow(int y, std::span<Eigen::Vector2f> places) const;
  void CellRow(int column, int y, std::span<Eigen::Vector2f> places) const;
  Eigen::Vector2f Exact(int x, int y) const;
  bool HasSamePixels() const {
    return is_view_ && out_width_ == camera_.width && out_height_ == camera_.height;
  }
  size_t NumPixels() const { return static_cast<size_t>(out_width_) * out_height_; }
  template <class Use>
  void ForEachShown(Use use) const;
  template <class T>
  std::vector<T> TakeNearest(std::span<const T> values) const;

  PromptImage image_;
  Camera camera_;
  std::optional<Photograph> photograph_;
  bool is_view_;
  int orientation_ = 1;  // see AcceptStored
  bool is_stored_ = false;
  int out_width_, out_height_;                // see ResizeTo
  mutable std::shared_ptr<const Grid> grid_;  // null: not computed yet
};

}  // namespace pepeseg
