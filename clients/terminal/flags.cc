#include "clients/terminal/flags.h"

#include <map>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

// Sets x and y of a message from "120,88.5".
template <class Point>
absl::Status SetPoint(const std::string& text, Point& point) {
  const std::vector<std::string> parts = absl::StrSplit(text, ',');
  double x = 0, y = 0;
  if (parts.size() != 2 || !absl::SimpleAtod(parts[0], &x) || !absl::SimpleAtod(parts[1], &y)) {
    return absl::InvalidArgumentError(
        absl::StrCat("point \"", text, "\": expected x,y in pixels, such as 320,240"));
  }
  point.set_x(x);
  point.set_y(y);
  return absl::OkStatus();
}

absl::Status SetBox(const std::string& text, v1::BoxPrompt& box) {
  const std::vector<std::string> parts = absl::StrSplit(text, ',');
  double numbers[4] = {};
  bool good = parts.size() == 4;
  for (size_t i = 0; good && i < 4; ++i) good = absl::SimpleAtod(parts[i], &numbers[i]);
  if (!good) {
    return absl::InvalidArgumentError(absl::StrCat(
        "box \"", text, "\": expected x,y,width,height in pixels, such as 100,80,240,160"));
  }
  box.set_x(numbers[0]), box.set_y(numbers[1]);
  box.set_width(numbers[2]), box.set_height(numbers[3]);
  return absl::OkStatus();
}

}  // namespace

std::vector<std::string> ReadNames(const std::string& value) {
  const absl::StatusOr<std::string> text = ReadFile(value);
  const bool is_list = text.ok() && text->find('\0') == std::string::npos;
  std::vector<std::string> names;
  for (absl::string_view name : absl::StrSplit(is_list ? *text : value, is_list ? '\n' : ',')) {
    name = absl::StripAsciiWhitespace(name);
    if (!name.empty()) names.emplace_back(name);
  }
  return names;
}

CLI::Option* AddNamesFlag(CLI::App& verb, const std::string& flag, std::vector<std::string>& names,
                          const std::string& help) {
  const auto read = [&names](const std::vector<std::string>& values) {
    names.clear();
    for (const std::string& value : values) {
      for (std::string& name : ReadNames(value)) names.push_back(std::move(name));
    }
  };
  return verb
      .add_option_function<std::vector<std::string>>(
          flag, read,
          help + "; separated by commas, or the option repeated, or a text file with one a line")
      ->type_name("FILE|NAMES");
}

absl::Status AddToPrompt(absl::string_view kind, const std::string& text, v1::Prompt& prompt) {
  if (kind == "point" || kind == "negative") {
    auto& point = *prompt.mutable_points()->add_points();
    point.set_negative(kind == "negative");
    return SetPoint(text, point);
  }
  if (kind == "mean") return SetPoint(text, *prompt.mutable_point_mean()->add_points());
  if (kind == "box") return SetBox(text, *prompt.mutable_box());
  if (kind == "scribble" || kind == "not-scribble") {
    auto& stroke = *prompt.mutable_scribbles()->add_strokes();
    stroke.set_negative(kind == "not-scribble");
    for (const absl::string_view vertex : absl::StrSplit(text, ' ', absl::SkipEmpty())) {
      RETURN_IF_ERROR(SetPoint(std::string(vertex), *stroke.add_path()));
    }
    return absl::OkStatus();
  }
  if (kind == "label") {
    prompt.set_label(text);
    return absl::OkStatus();
  }
  v1::MaskImage& mask = kind == "scribbles"       ? *prompt.mutable_scribbles()->mutable_positive()
                        : kind == "not-scribbles" ? *prompt.mutable_scribbles()->mutable_negative()
                        : kind == "previous-mask"
                            ? *prompt.mutable_points()->mutable_previous_mask()
                            : *prompt.mutable_mask();
  ASSIGN_OR_RETURN(*mask.mutable_png(), ReadFile(text));
  return absl::OkStatus();
}

CLI::Option* AddFrameFlag(CLI::App& verb, v1::PixelFrame& frame) {
  // The callback runs during parsing, when the locals of this function are gone.
  static const std::map<std::string, v1::PixelFrame> frames = {
      {"photograph", v1::PIXEL_FRAME_PHOTOGRAPH}, {"view", v1::PIXEL_FRAME_VIEW}};
  frame = v1::PIXEL_FRAME_PHOTOGRAPH;
  return verb
      .add_option_function<std::string>(
          "--frame", [&frame](const std::string& name) { frame = frames.at(name); },
          "Pixels are those of the uploaded photograph, or of the view trained on, which is "
          "undistorted, cropped and shrunk")
      ->check(CLI::IsMember({"photograph", "view"}))
      ->default_str("photograph");
}

}  // namespace pepeseg::client::cli
