// Developer program: runs stage two on a dataset folder with label images and scores it by one
// click per label. Reads the result of stage one from --gaussians, a PLY, or trains it and writes
// it there. The click is the pixel deepest inside the label in the first held-out view; the score
// is the mean IoU over all held-out views at each given scale and threshold. Prints one line of
// JSON.
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/base/status_macros.h"
#include "core/dataset/import.h"
#include "core/evaluate/mask_scores.h"
#include "core/features/train_features.h"
#include "core/formats/decode_image.h"
#include "core/formats/encode_png.h"
#include "core/formats/gaussian_ply.h"
#include "core/prompt/resolve_prompt.h"
#include "core/query/segmenter.h"
#include "core/reconstruct/reconstruct.h"
#include "tests/bench/stage_flags.h"

namespace pepeseg {
namespace {

struct BenchOptions : StageOptions {
  std::string folder, gaussians;
  std::string device = "cpu";  // or cuda
  int num_threads = 0;
  std::vector<int> smooth = {0};         // neighbours to average; 0: features as trained
  std::string pictures;                  // folder; empty: none
  double scale = 0.3, threshold = 0.75;  // used for the images
};

double CoreSeconds() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

absl::StatusOr<Gaussians> GetGaussians(Backend& backend, const Capture& capture,
                                       const BenchOptions& options) {
  if (std::filesystem::exists(options.gaussians)) {
    return ReadGaussianPly(options.gaussians, options.gaussians);
  }
  ASSIGN_OR_RETURN(Gaussians gaussians,
                   Reconstruct(backend, capture, options.reconstruct,
                               [](const StepReport&) { return absl::OkStatus(); }));
  if (!options.gaussians.empty()) {
    RETURN_IF_ERROR(WriteGaussianPly(options.gaussians, gaussians));
  }
  return gaussians;
}

// A held-out view with its labels.
struct ScoredView {
  const View* view;
  ModelView camera;
  LabelImage labels;

  std::vector<uint8_t> MaskOf(uint32_t label) const {
    std::vector<uint8_t> mask;
    for (size_t i = 0; i < labels.labels.size(); ++i) {
      const bool ignored = !view->ignore.empty() && view->ignore[i] != 0;
      mask.push_back(labels.labels[i] == label && !ignored ? 1 : 0);
    }
    return mask;
  }
};

absl::StatusOr<std::vector<ScoredView>> LoadScoredViews(const std::string& folder,
                                                        const Capture& capture) {
  std::vector<ScoredView> views;
  for (const View& view : capture.views) {
    if (!view.held_out) continue;
    const auto path = std::filesystem::path(folder) / "labels" /
                      std::filesystem::path(view.name).stem().replace_extension(".png");
    ASSIGN_OR_RETURN(LabelImage labels, DecodeLabels(path, path.string()));
    views.push_back(
        {&view, {view.name, view.camera, view.cam_from_world, true}, std::move(labels)});
  }
  return views;
}

// Returns the pixel that survives the most erosions (4-neighbours).
PointPrompt DeepestPixel(std::vector<uint8_t> mask, int width, int height) {
  size_t last = 0;
  while (true) {
    std::vector<uint8_t> eroded(mask.size());
    bool any = false;
    for (int y = 1; y + 1 < height; ++y) {
      for (int x = 1; x + 1 < width; ++x) {
        const size_t i = static_cast<size_t>(y) * width + x;
        eroded[i] = mask[i] & mask[i - 1] & mask[i + 1] & mask[i - width] & mask[i + width];
        any |= eroded[i] != 0;
      }
    }
    last = std::find(mask.begin(), mask.end(), 1) - mask.begin();
    if (!any) break;
    mask = std::move(eroded);
  }
  const size_t x = last % width, y = last / width;
  return {static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5, true};
}

// Returns the mean IoU of a label over the views that show at least 100 pixels of it.
absl::StatusOr<double> ScoreLabel(const Segmenter& segmenter, const std::vector<ScoredView>& views,
                                  uint32_t label, double scale, double threshold) {
  constexpr int64_t kMinPixels = 100;
  std::optional<Query> query;
  double sum = 0;
  int count = 0;
  for (const ScoredView& view : views) {
    const std::vector<uint8_t> truth = view.MaskOf(label);
    if (std::count(truth.begin(), truth.end(), 1) < kMinPixels) continue;
    if (!query) {
      const std::vector<PointPrompt> click = {
          DeepestPixel(truth, view.labels.width, view.labels.height)};
      ASSIGN_OR_RETURN(query, ResolvePrompt(segmenter, {view.camera, click}, {scale, threshold}));
    }
    ASSIGN_OR_RETURN(const auto results, segmenter.Segment(*query, {&view.camera, 1}));
    sum += Iou(results[0].mask.pixels, truth, view.view->ignore);
    ++count;
  }
  return count == 0 ? 0 : sum / count;
}

absl::StatusOr<nlohmann::json> Score(const Segmenter& segmenter,
                                     const std::vector<ScoredView>& views) {
  std::map<uint32_t, int64_t> labels;
  for (const ScoredView& view : views) {
    for (const uint32_t label : view.labels.labels) ++labels[label];
  }
  labels.erase(0);
  nlohmann::json out;
  for (const double scale : {0.01, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0}) {
    for (const double threshold : {0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95}) {
      nlohmann::json row = {{"scale", scale}, {"threshold", threshold}};
      double sum = 0;
      for (const auto& [label, pixels] : labels) {
        ASSIGN_OR_RETURN(const double iou, ScoreLabel(segmenter, views, label, scale, threshold));
        row["iou"][std::to_string(label)] = iou;
        sum += iou;
      }
      row["mean"] = sum / static_cast<double>(labels.size());
      out.push_back(row);
    }
  }
  return out;
}

// Writes photograph | render | similarity for each label and held-out view.
absl::Status WritePictures(const Segmenter& segmenter, const std::vector<ScoredView>& views,
                           const BenchOptions& options) {
  std::map<uint32_t, Query> queries;
  for (size_t v = 0; v < views.size(); ++v) {
    const ScoredView& view = views[v];
    std::map<uint32_t, int> labels;
    for (const uint32_t label : view.labels.labels) ++labels[label];
    labels.erase(0);
    for (const auto& [label, pixels] : labels) {
      Query& query = queries[label];
      if (query.features.empty()) {
        const std::vector<PointPrompt> click = {
            DeepestPixel(view.MaskOf(label), view.labels.width, view.labels.height)};
        ASSIGN_OR_RETURN(query, ResolvePrompt(segmenter, {view.camera, click},
                                              {options.scale, options.threshold}));
      }
      ASSIGN_OR_RETURN(const auto results,
                       segmenter.Segment(query, {&view.camera, 1}, {.want_similarity = true}));
      ASSIGN_OR_RETURN(const Image render, segmenter.RenderColor(view.camera));
      Image all = {3 * render.width, render.height, 3, {}};
      for (size_t i = 0; i < all.pixels.max_size() && i < size_t{9} * render.width * render.height;
           ++i) {
        const size_t column = i / 3 % all.width, y = i / 3 / all.width;
        const size_t pixel = y * render.width + column % render.width, k = i % 3;
        const uint8_t values[] = {
            view.view->photo.pixels[3 * pixel + k], render.pixels[3 * pixel + k],
            static_cast<uint8_t>(255 * std::max(0.0f, results[0].similarity[pixel]) *
                                 (k > 0 || results[0].mask.pixels[pixel] ? 1.0f : 0.6f))};
        all.pixels.push_back(values[column / render.width]);
      }
      ASSIGN_OR_RETURN(const std::string png, EncodePng(all));
      std::ofstream(options.pictures + "/view" + std::to_string(v) + "_label" +
                        std::to_string(label) + ".png",
                    std::ios::binary)
          << png;
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<Backend>> MakeBackend(const BenchOptions& options) {
  if (options.device == "cpu") return MakeCpuBackend(options.num_threads);
  std::string error;
  auto backend = MakeCudaBackend({}, &error);
  if (backend == nullptr) return absl::UnavailableError(error);
  return backend;
}

absl::StatusOr<nlohmann::json> Run(const BenchOptions& options) {
  ASSIGN_OR_RETURN(const auto backend, MakeBackend(options));
  ASSIGN_OR_RETURN(const auto files, ListDataset(options.folder));
  ASSIGN_OR_RETURN(const Capture capture, ImportCapture(files, {}));
  ASSIGN_OR_RETURN(Gaussians gaussians, GetGaussians(*backend, capture, options));
  const double start = CoreSeconds();
  const auto start_time = std::chrono::steady_clock::now();
  nlohmann::json out = {{"gaussians", gaussians.count}, {"device", backend->name()}};
  ASSIGN_OR_RETURN(FeatureField field, TrainFeatures(*backend, capture, gaussians, options.features,
                                                     [&](const StepReport& report) {
                                                       if (report.step % 500 == 1)
                                                         out["loss"].push_back(report.loss);
                                                       return absl::OkStatus();
                                                     }));
  out["features_core_seconds"] = CoreSeconds() - start;
  out["features_seconds"] =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start_time).count();
  Model model;
  model.gaussians = std::move(gaussians);
  model.field = std::move(field);
  model.scene_radius = SceneRadius(capture);
  ASSIGN_OR_RETURN(const auto segmenter, Segmenter::Create(*backend, std::move(model)));
  ASSIGN_OR_RETURN(const auto views, LoadScoredViews(options.folder, capture));
  if (!options.pictures.empty()) RETURN_IF_ERROR(WritePictures(*segmenter, views, options));
  ASSIGN_OR_RETURN(out["scores"], Score(*segmenter, views));
  return out;
}

}  // namespace
}  // namespace pepeseg

// NOLINTNEXTLINE(bugprone-exception-escape): CLI11 throws only what CLI11_PARSE catches.
int main(int argc, char** argv) {
  CLI::App app("Stage two on a dataset folder, scored by one click per label");
  pepeseg::BenchOptions options;
  app.add_option("folder", options.folder)->required();
  app.add_option("--gaussians", options.gaussians);
  pepeseg::AddStageFlags(app, options);
  app.add_option("--device", options.device, "cpu or cuda");
  app.add_option("--threads", options.num_threads);
  app.add_option("--pictures", options.pictures);
  app.add_option("--scale", options.scale);
  app.add_option("--threshold", options.threshold);
  CLI11_PARSE(app, argc, argv);
  const auto result = pepeseg::Run(options);
  if (!result.ok()) {
    std::cerr << result.status() << "\n";
    return 1;
  }
  std::cout << result->dump() << "\n";
  return 0;
}
