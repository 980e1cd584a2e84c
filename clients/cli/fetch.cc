// The verbs that fetch files of a model: "render" (pictures of it, or of a part), "photograph" and
// "export" (Gaussians, or the masks of labels).
#include <algorithm>
#include <filesystem>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "clients/cli/annotations.h"
#include "clients/cli/request_flags.h"
#include "clients/cli/verbs.h"
#include "clients/cpp/client.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/flags.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/view_picture.h"

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

// A format of Gaussians. The other formats of an export are of the masks of labels.
struct GaussianFormat {
  const char* word;  // of --format
  v1::GaussianFormat format;
  const char* what;  // it has
};
constexpr GaussianFormat kGaussianFormats[] = {
    {"ply", v1::GAUSSIAN_FORMAT_PLY, "the Gaussians"},
    {"spz", v1::GAUSSIAN_FORMAT_SPZ, "the Gaussians, compressed to about a tenth"},
    {"glb", v1::GAUSSIAN_FORMAT_GLB, "the Gaussians as glTF"},
    {"sog", v1::GAUSSIAN_FORMAT_SOG, "the Gaussians as images in a zip, smaller than SPZ"},
    {"html", v1::GAUSSIAN_FORMAT_HTML, "a page that shows the Gaussians in a browser"}};

// Returns the format that the end of a file's name says, or "ply".
std::string FormatOfName(const std::string& file) {
  std::string end = std::filesystem::path(file).extension().string();
  absl::AsciiStrToLower(&end);
  for (const GaussianFormat& format : kGaussianFormats) {
    if (end == absl::StrCat(".", format.word)) return format.word;
  }
  return "ply";
}

struct ExportFlags {
  std::string scene;
  std::string file;  // to write; a folder for some formats
  std::string model = "live";
  std::string format;  // empty: that of the file's name
  std::string origin = "local";
  bool segment_ids = false;
  SubsetFlags subset;
  AnnotationFlags annotations;
};

// Writes what the segments' ids in an export mean to FILE.segments.json: the segments of each level
// with their parents, sizes and boxes.
absl::Status WriteSegmentsOf(const Client& client,
                             const v1::ExportGaussiansResponse::Header& header,
                             const ExportFlags& flags) {
  v1::DecomposeModelRequest request;
  request.set_model(header.model());
  const std::vector<double>& scales = flags.subset.scales;
  request.mutable_scales()->Add(scales.begin(), scales.end());
  ASSIGN_OR_RETURN(const v1::DecomposeModelResponse answer, client.Decompose(request));
  return WriteFile(flags.file + ".segments.json", ToJson(answer) + "\n");
}

// Writes the Gaussians, or the masks of the labels, and prints what it wrote.
absl::Status RunExport(const Shell& shell, const ExportFlags& flags) {
  ASSIGN_OR_RETURN(const v1::Subset subset, ParseSubset(flags.subset, flags.scene));
  const std::string word = flags.format.empty() ? FormatOfName(flags.file) : flags.format;
  const auto* const found = std::ranges::find_if(
      kGaussianFormats, [&word](const GaussianFormat& format) { return word == format.word; });
  if (found == std::ranges::end(kGaussianFormats)) {
    const bool of_all = subset.of_case() == v1::Subset::OF_NOT_SET && !flags.segment_ids;
    if (of_all) {
      return FetchAnnotations(shell, ModelName(flags.scene, flags.model), flags.format, flags.file,
                              flags.annotations, flags.subset.scales);
    }
    return absl::InvalidArgumentError(absl::StrCat(
        "--format ", flags.format,
        " has the masks of labels: leave out --selection, --segment, --without and --segment-ids"));
  }
  const AnnotationFlags& of_masks = flags.annotations;
  if (!of_masks.views.empty() || !of_masks.labels.empty() || !of_masks.table.empty() ||
      of_masks.level >= 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--views, --labels, --segments and --table are of masks: name their --format, ",
        absl::StrJoin(AnnotationFormats(), ", ")));
  }
  v1::ExportGaussiansRequest request;
  request.set_model(absl::StrCat(SceneName(flags.scene), "/models/", flags.model));
  *request.mutable_subset() = subset;
  request.set_coordinates(flags.origin == "local" ? v1::COORDINATES_LOCAL : v1::COORDINATES_WORLD);
  request.set_format(found->format);
  if (flags.segment_ids) {
    const std::vector<double>& scales = flags.subset.scales;
    request.mutable_segment_ids()->mutable_scales()->Add(scales.begin(), scales.end());
  }
  const Client client(shell.channel);
  ASSIGN_OR_RETURN(const v1::ExportGaussiansResponse::Header header,
                   client.Export(request, flags.file));
  ASSIGN_OR_RETURN(const std::string origin,
                   WriteOrigin(header.has_origin() ? &header.origin() : nullptr, flags.file));
  if (flags.segment_ids) RETURN_IF_ERROR(WriteSegmentsOf(client, header, flags));
  if (shell.json) {
    PrintJson(header);
  } else {
    Print(absl::StrFormat("%s: %d Gaussians, %.1f MB, of %s", flags.file, header.num_gaussians(),
                          static_cast<double>(header.num_bytes()) * 1e-6, header.model()));
    if (!origin.empty()) {
      const bool is_ply = found->format == v1::GAUSSIAN_FORMAT_PLY;
      Print(absl::StrCat("positions are relative to the origin in ", origin,
                         is_ply ? " and in the PLY's comment; --origin world adds it" : ""));
    }
  }
  return absl::OkStatus();
}

struct PhotographFlags {
  std::string scene;
  std::string view;
  std::string file;  // to write
  std::string model = "live";
  v1::PixelFrame frame = v1::PIXEL_FRAME_UNSPECIFIED;
  int max_side = 0;       // pixels; 0: not shrunk
  bool original = false;  // the uploaded file, without frame and max_side
};

// Writes the image file and prints its size.
absl::Status RunPhotograph(const Shell& shell, const PhotographFlags& flags) {
  v1::GetPhotographRequest request;
  request.set_parent(absl::StrCat(SceneName(flags.scene), "/models/", flags.model));
  request.set_photograph(flags.view);
  request.set_max_side(flags.max_side);
  request.set_original(flags.original);
  if (!flags.original) request.set_frame(flags.frame);
  const Client client(shell.channel);
  ASSIGN_OR_RETURN(const Client::Photograph photograph, client.GetPhotograph(request));
  RETURN_IF_ERROR(WriteFile(flags.file, photograph.bytes));
  if (shell.json) {
    PrintJson(photograph.header);
    return absl::OkStatus();
  }
  const auto& header = photograph.header;
  const std::string size =
      header.width() > 0 ? absl::StrCat(header.width(), "x", header.height(), ", ") : "";
  Print(absl::StrFormat("%s: %s%.1f MB, %s", flags.file, size,
                        static_cast<double>(header.num_bytes()) * 1e-6, header.content_type()));
  return absl::OkStatus();
}

}  // namespace

void AddRender(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<RenderFlags>();
  CLI::App* verb = app.add_subcommand("render", "Render a model from its views");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  AddNamesFlag(*verb, "--views", flags->views, "Names of views; by default all");
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

void AddExport(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<ExportFlags>();
  CLI::App* verb =
      app.add_subcommand("export",
                         "Fetch a model, or a part of it, for splat viewers; or the masks of all "
                         "labels for annotation tools");
  std::vector<std::string> formats;
  std::string contents;
  for (const GaussianFormat& format : kGaussianFormats) {
    formats.emplace_back(format.word);
    absl::StrAppend(&contents, format.word, ": ", format.what, "; ");
  }
  std::ranges::copy(AnnotationFormats(), std::back_inserter(formats));
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  verb->add_option("FILE", flags->file,
                   "File to write; for masks but coco a folder, or a zip if it ends in .zip")
      ->required();
  verb->add_option("--model", flags->model, "Number of the model")->capture_default_str();
  verb->add_option(
          "--format", flags->format,
          contents +
              "coco, yolo, labelme, masks (a PNG each), cvat or ids (a PNG with all): the "
              "masks of the scene's labels in its views. By default what FILE ends in, .spz, "
              ".glb, .sog or .html, else ply")
      ->check(CLI::IsMember(formats));
  verb->add_option(
          "--origin", flags->origin,
          "Positions of a scene with map coordinates. local: floats relative to an origin, "
          "which is in FILE.origin.json and in a comment of the PLY; world: doubles in a PLY, a "
          "moved node in a GLB, as local in SPZ, SOG and HTML")
      ->check(CLI::IsMember({"local", "world"}))
      ->capture_default_str();
  AddAnnotationFlags(*verb, flags->annotations);
  AddSubsetFlags(*verb, flags->subset);
  verb->add_flag(
      "--segment-ids", flags->segment_ids,
      "Add to each Gaussian of a PLY the ids of the segments that it is in, as segment_0, "
      "segment_1, ..., and write the segments to FILE.segments.json");
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunExport(shell, *flags); }; });
}

void AddPhotograph(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<PhotographFlags>();
  CLI::App* verb = app.add_subcommand("photograph", "Fetch the photograph of a view");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  verb->add_option("VIEW", flags->view, "Name of the view, as `pepeseg scenes SCENE` prints it")
      ->required();
  verb->add_option("OUT", flags->file, "File to write")->required();
  verb->add_option("--model", flags->model, "Number of the model")->capture_default_str();
  verb->add_option("--max-side", flags->max_side,
                   "Longer side to which it is shrunk, pixels; 0: not shrunk")
      ->check(CLI::Range(0, 16384))
      ->capture_default_str();
  CLI::Option* frame = AddFrameFlag(*verb, flags->frame);
  verb->add_flag("--original", flags->original, "Fetch the uploaded file, byte for byte")
      ->excludes(frame)
      ->excludes("--max-side");
  verb->callback(
      [flags, &shell] { shell.verb = [&, flags] { return RunPhotograph(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
