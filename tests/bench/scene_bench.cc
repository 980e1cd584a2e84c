// Developer program: imports a dataset folder, runs stage one and scores it on the held-out views.
// Prints one line of JSON; --renders writes photograph | render for each held-out view.
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "core/base/status_macros.h"
#include "core/dataset/import.h"
#include "core/evaluate/image_scores.h"
#include "core/evaluate/lpips.h"
#include "core/formats/encode_png.h"
#include "core/reconstruct/reconstruct.h"
#include "core/scene/camera.h"
#include "tests/bench/stage_flags.h"

namespace pepeseg {
namespace {

struct BenchOptions : StageOptions {
  std::string folder;
  bool disparity = false;  // depth/ holds disparity
  ImportOptions import;
  int num_threads = 0;
  std::string lpips;    // ONNX file; empty: not measured
  std::string renders;  // folder; empty: none
  bool verbose = false;
};

// Measures wall and core (user + system) seconds since its construction.
class Stopwatch {
 public:
  nlohmann::json Seconds() const { return {{"wall", Wall() - wall_}, {"core", Core() - core_}}; }

 private:
  static double Wall() {
    const auto now = std::chrono::steady_clock::now().time_since_epoch();
    return std::chrono::duration<double>(now).count();
  }
  static double Core() {
    rusage usage = {};
    getrusage(RUSAGE_SELF, &usage);
    const auto seconds = [](const timeval& t) {
      return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
    };
    return seconds(usage.ru_utime) + seconds(usage.ru_stime);
  }

  double wall_ = Wall(), core_ = Core();
};

void AddOptions(CLI::App& app, BenchOptions& options) {
  AddStageFlags(app, options);
  app.add_option("folder", options.folder)->required();
  app.add_flag("--disparity", options.disparity, "depth/ holds disparity");
  app.add_option("--image-scale", options.import.image_scale);
  app.add_option("--threads", options.num_threads);
  app.add_option("--lpips", options.lpips, "ONNX file, see README.md");
  app.add_option("--renders", options.renders);
  app.add_flag("--verbose", options.verbose);
}

Image RenderView(Backend& backend, const Gaussians& gaussians, const View& view, float near_plane) {
  const int64_t num_pixels = int64_t{view.camera.width} * view.camera.height;
  const Buffer<float> planes(backend, std::span<const float>(gaussians.planes));
  Buffer<float> color(backend, 3 * num_pixels);
  RenderScratch scratch;
  backend.Render(
      {.gaussians = {planes.span().data, gaussians.count, gaussians.count, gaussians.sh_degree},
       .view = ToPinholeView(view.camera, view.cam_from_world),
       .near_plane = near_plane,
       .active_sh_degree = gaussians.sh_degree,
       .scratch = &scratch,
       .color = color.span()});
  std::vector<float> host(static_cast<size_t>(3 * num_pixels));
  color.Download(host);
  Image image = {view.camera.width, view.camera.height, 3, {}};
  for (int64_t i = 0; i < 3 * num_pixels; ++i) {
    const float value = host[i % 3 * num_pixels + i / 3];
    image.pixels.push_back(static_cast<uint8_t>(std::clamp(value * 255 + 0.5f, 0.0f, 255.0f)));
  }
  return image;
}

// Returns the PSNR after fitting gain and offset of each channel of the render. The difference from
// the plain PSNR is the cost of exposure differences.
double PsnrOfBestExposure(const View& view, const Image& render) {
  double squared_error = 0, num = 0;
  for (int channel = 0; channel < 3; ++channel) {
    double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
    for (size_t i = 0; i < render.pixels.size() / 3; ++i) {
      if (!view.ignore.empty() && view.ignore[i] != 0) continue;
      const double a = render.pixels[3 * i + channel] / 255.0;
      const double b = view.photo.pixels[3 * i + channel] / 255.0;
      n += 1, x += a, y += b, xx += a * a, xy += a * b, yy += b * b;
    }
    const double covariance = xy - x * y / n, variance = xx - x * x / n;
    squared_error += yy - y * y / n - covariance * covariance / std::max(1e-9, variance);
    num += n;
  }
  return -10 * std::log10(std::max(1e-10, squared_error / num));
}

absl::Status WriteRenders(Backend& backend, const Capture& capture, const Gaussians& gaussians,
                          const std::string& folder) {
  const auto near_plane = static_cast<float>(0.01 * SceneRadius(capture));
  int index = 0;
  for (const View& view : capture.views) {
    if (!view.held_out) continue;
    const Image render = RenderView(backend, gaussians, view, near_plane);
    Image both = {2 * render.width, render.height, 3, {}};
    const int64_t row = int64_t{3} * render.width;
    for (int64_t y = 0; y < render.height; ++y) {
      for (const Image* half : {&view.photo, &render}) {
        both.pixels.insert(both.pixels.end(), half->pixels.begin() + y * row,
                           half->pixels.begin() + (y + 1) * row);
      }
    }
    ASSIGN_OR_RETURN(const std::string png, EncodePng(both));
    std::ofstream(folder + "/held_out_" + std::to_string(index++) + ".png", std::ios::binary)
        << png;
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<ViewScores>> Score(Backend& backend, const Capture& capture,
                                              const Gaussians& gaussians,
                                              const std::string& weights) {
  if (weights.empty()) return ScoreHeldOut(backend, capture, gaussians);
  ASSIGN_OR_RETURN(Lpips lpips, Lpips::Open(weights));
  return ScoreHeldOut(backend, capture, gaussians,
                      [&lpips](const Image& photo, std::span<const float> rendering) {
                        const absl::StatusOr<double> distance = lpips.Distance(photo, rendering);
                        return distance.ok() ? std::optional<double>(*distance) : std::nullopt;
                      });
}

absl::StatusOr<nlohmann::json> Run(const BenchOptions& options) {
  const auto backend = MakeCpuBackend(options.num_threads);
  nlohmann::json out = {{"folder", options.folder},
                        {"device", backend->name()},
                        {"steps", options.reconstruct.num_steps}};
  const Stopwatch prepare;
  ASSIGN_OR_RETURN(const auto files,
                   ListDataset(options.folder, options.disparity ? DepthPrior::Kind::kDisparity
                                                                 : DepthPrior::Kind::kDepth));
  ASSIGN_OR_RETURN(const Capture capture, ImportCapture(files, options.import));
  out["prepare"] = prepare.Seconds();
  out["size"] = {capture.views[0].camera.width, capture.views[0].camera.height};
  out["views"] = capture.views.size();
  out["points"] = capture.points.size();
  out["warnings"] = capture.warnings;
  const Stopwatch reconstruct;
  StepReport last;
  double depth_loss = std::nan("");  // of the latest step with a depth loss
  ASSIGN_OR_RETURN(const Gaussians gaussians,
                   Reconstruct(*backend, capture, options.reconstruct, [&](const StepReport& r) {
                     last = r;
                     if (!std::isnan(r.depth_loss)) depth_loss = r.depth_loss;
                     if (options.verbose && r.step % 200 == 0) {
                       std::fprintf(stderr, "%6ld loss %.4f psnr %.2f gaussians %ld\n",
                                    long(r.step), r.loss, r.psnr, long(r.num_gaussians));
                     }
                     return absl::OkStatus();
                   }));
  out["reconstruct"] = reconstruct.Seconds();
  out["gaussians"] = gaussians.count;
  out["culled_degenerate"] = last.num_culled_degenerate;
  out["refined"] = last.num_refined;
  out["refine_split"] = last.num_refine_split;
  out["skipped_gradients"] = last.num_skipped_gradients;
  out["depth_loss"] = depth_loss;  // null: no step had one
  out["skipped_depths"] = last.num_skipped_depths;
  ASSIGN_OR_RETURN(const auto scores, Score(*backend, capture, gaussians, options.lpips));
  for (const ViewScores& view : scores) {
    out["held_out"].push_back(
        {{"view", view.view}, {"psnr", view.scores.psnr}, {"ssim", view.scores.ssim}});
    if (view.scores.lpips) out["held_out"].back()["lpips"] = *view.scores.lpips;
  }
  if (const auto lpips = Mean(scores).lpips) out["lpips"] = *lpips;
  out["psnr"] = Mean(scores).psnr;
  out["ssim"] = Mean(scores).ssim;
  Capture training = capture;
  for (View& view : training.views) view.held_out = !view.held_out;
  ASSIGN_OR_RETURN(const auto training_scores, ScoreHeldOut(*backend, training, gaussians));
  out["training_psnr"] = Mean(training_scores).psnr;
  const auto near_plane = static_cast<float>(0.01 * SceneRadius(capture));
  for (const View& view : capture.views) {
    if (!view.held_out) continue;
    const Image render = RenderView(*backend, gaussians, view, near_plane);
    out["psnr_of_best_exposure"].push_back(PsnrOfBestExposure(view, render));
  }
  if (!options.renders.empty()) {
    RETURN_IF_ERROR(WriteRenders(*backend, capture, gaussians, options.renders));
  }
  return out;
}

}  // namespace
}  // namespace pepeseg

// NOLINTNEXTLINE(bugprone-exception-escape): CLI11 throws only what CLI11_PARSE catches.
int main(int argc, char** argv) {
  CLI::App app("Stage one on a dataset folder, measured");
  pepeseg::BenchOptions options;
  pepeseg::AddOptions(app, options);
  CLI11_PARSE(app, argc, argv);
  const auto result = pepeseg::Run(options);
  if (!result.ok()) {
    std::cerr << result.status() << "\n";
    return 1;
  }
  std::cout << result->dump() << "\n";
  return 0;
}
