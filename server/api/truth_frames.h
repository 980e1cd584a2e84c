#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "pepeseg/v1/evaluation_service.pb.h"
#include "server/api/request_image.h"

namespace pepeseg {

// The photographs of a model's views, as far as they are stored.
class ViewPhotographs {
 public:
  virtual ~ViewPhotographs() = default;
  // Returns the EXIF orientation of the view's photograph, [1, 8]; 1 if it is not known.
  virtual int Orientation(const ModelView& view) = 0;
  // Returns the upright photograph in RGB, with at most `max_side` pixels on its longer side.
  virtual absl::StatusOr<Image> Upright(const ModelView& view, int max_side) = 0;
};

// The pixel frames (core/dataset/pixel_frame.h) that the images of an EvaluateModel request are of.
// Requests are in upright pixels, but many tools write label images for the stored ones.
class TruthFrames {
 public:
  // One tool has made all images of a kind.
  enum class Kind { kTruth, kIgnore, kPrompt };

  // All images are in the frame of the request.
  TruthFrames() = default;

  // Finds out by sizes or, where both frames of a photograph have one size, by the borders of at
  // most eight images of a kind. Where those of ignore masks or prompts fit neither frame better,
  // they are of the frame of the truth, and that is then upright. Views and images that are
  // malformed are left to their readers. Returns the error of `check_wanted`, which is called
  // before each image.
  static absl::StatusOr<TruthFrames> Choose(const v1::EvaluateModelRequest& request,
                                            const Model& model, ViewPhotographs& photographs,
                                            absl::FunctionRef<absl::Status()> check_wanted);

  // Returns the image that a kind of images of the view are in the pixels of.
  Frame Image(const ModelView& view, v1::PixelFrame frame, Kind kind) const;

  // Returns a sentence for each kind of which images are turned, with the names of their views.
  std::vector<std::string> Notes() const;

 private:
  std::map<std::string, int> orientations_;  // by view, without 1
  std::set<Kind> stored_;                    // kinds that are of the stored pixels if both fit
  std::map<Kind, std::vector<std::string>> turned_;  // names of views
};

}  // namespace pepeseg
