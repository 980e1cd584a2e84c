#pragma once

#include <string>

#include "tests/server/service_test.h"

namespace pepeseg {

constexpr int kWidth = 96, kHeight = 64;  // size of the views of model_worker.cc

// Returns a prompt of one point in view middle.jpg.
inline v1::Prompt ClickAt(double x, double y = 32) {
  v1::Prompt prompt;
  prompt.mutable_view()->set_view("middle.jpg");
  auto& point = *prompt.mutable_points()->add_points();
  point.set_x(x);
  point.set_y(y);
  return prompt;
}

// Returns a request of a click for the scene's live model.
template <class Request>
Request Click(double x, double y = 32) {
  Request request;
  request.set_model("scenes/shelf/models/live");
  *request.mutable_prompt() = ClickAt(x, y);
  return request;
}

// A server with the model of model_worker.cc as "scenes/shelf/models/1": a red square at pixels
// around (30, 32) of view middle.jpg and a blue one around (66, 32), 2 units away. Each has 10,000
// Gaussians and is one segment of every granularity level: red is 1, blue is 2.
struct ShelfModel : EmptyScene {
  ShelfModel() : EmptyScene(PEPESEG_MODEL_WORKER) { TrainToTheEnd("shelf", "file"); }
  static void SetSegment(int level, int id, v1::Subset& subset) {
    subset.mutable_segment()->set_level(level);
    subset.mutable_segment()->set_id(id);
  }
  static constexpr char kModel[] = "scenes/shelf/models/live";
};

}  // namespace pepeseg
