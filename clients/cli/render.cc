// The verb "render": pictures of a model, or of a part of it.
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/request_flags.h"
#include "clients/cli/shell.h"
#include "clients/cli/view_picture.h"
#include "clients/cpp/client.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;
using Request = v1::RenderViewRequest;

struct RenderFlags {
  std::string scene;
  std::string model = "live";
  std::vector<std::string> views;  // empty: all
  std::string out = ".";           // folder
  std::string content = "color";
  SubsetFlags subset;
  int level = 0;       // of CONTENT_SEGMENTS; 0: the finest
  double scale = 0.5;  // of CONTENT_FEATURES, a quantile
  v1::PixelFrame frame = v1::PIXEL_FRAME_PHOTOGRAPH;
  int max_side = 0;  // pixels; 0: the server chooses
};

// Converts a value of --content.
Request::Content ContentOf(const std::string& name) {
  if (name == "depth") return Request::CONTENT_DEPTH;
  if (name == "segments") return Request::CONTENT_SEGMENTS;
  if (name == "features") return Request::CONTENT_FEATURES;
  return Request::CONTENT_COLOR;
}

absl::StatusOr<Request> BuildRequest(const RenderFlags& flags) {
  Request request;
  request.set_model(ModelName(flags.scene, flags.model));
  request.set_content(ContentOf(flags.content));
  ASSIGN_OR_RETURN(*request.mutable_subset(), ParseSubset(flags.subset, flags.scene));
  request.mutable_decomposition_scales()->Add(flags.subset.scales.begin(),
                                              flags.subset.scales.end());
  request.set_level(flags.level);
  request.set_feature_scale(flags.scale);
  request.set_frame(flags.frame);
  request.set_max_side(flags.max_side);
  return request;
}

// Prints the path of a picture, and the unit of a depth image.
void PrintPicture(const Shell& shell, const Request& request, const v1::RenderViewResponse& answer,
                  const fs::path& path) {
  const bool is_depth = request.content() == Request::CONTENT_DEPTH;
  if (shell.json) {
    nlohmann::ordered_json json{{"view", request.viewpoint().view()}, {"file", path.string()}};
    if (is_depth) json["depth_unit"] = answer.depth_unit();
    Print(json.dump());
  } else {
    Print(is_depth
              ? absl::StrFormat("%s  %.6g scene units a step", path.string(), answer.depth_unit())
              : path.string());
  }
}

absl::Status RunRender(const Shell& shell, const RenderFlags& flags) {
  ASSIGN_OR_RETURN(Request request, BuildRequest(flags));
  const Client client(shell.channel);
  std::vector<std::string> names = flags.views;
  if (names.empty()) {
    ASSIGN_OR_RETURN(const std::vector<v1::View> views, client.ListViews(request.model()));
    for (const v1::View& view : views) names.push_back(view.view());
  }
  for (const std::string& view : names) {
    request.mutable_viewpoint()->set_view(view);
    ASSIGN_OR_RETURN(const v1::RenderViewResponse answer, client.Render(request));
    const fs::path path = fs::path(flags.out) / (Stem(view) + ".png");
    RETURN_IF_ERROR(WriteFile(path, answer.png()));
    PrintPicture(shell, request, answer, path);
  }
  return absl::OkStatus();
}

}  // namespace

void AddRender(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<RenderFlags>();
  CLI::App* verb = app.add_subcommand("render", "Render a model from its views");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  verb->add_option("--views", flags->views, "Names of views; by default all");
  verb->add_option("--model", flags->model, "Number of the model")->capture_default_str();
  verb->add_option("--out", flags->out, "Folder for STEM.png")->capture_default_str();
  verb->add_option(
          "--content", flags->content,
          "What pixels show. features: as colours; depth and segments (their ids): 16-bit grey")
      ->check(CLI::IsMember({"color", "depth", "segments", "features"}))
      ->capture_default_str();
  verb->add_option("--level", flags->level, "Level of segments; 0: the finest")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  verb->add_option("--scale", flags->scale,
                   "Scale of features: 0 for small parts, 1 for the largest")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  AddFrameFlag(*verb, flags->frame);
  verb->add_option("--max-side", flags->max_side,
                   "Longer side of the pictures, pixels; by default that of 2 megapixels")
      ->check(CLI::Range(1, 16384));
  AddSubsetFlags(*verb, flags->subset);
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunRender(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
