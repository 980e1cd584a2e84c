#include <array>
#include <optional>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "core/formats/colmap_records.h"

// COLMAP's text files: one line per record, two for an image; lines that begin with '#' are
// comments.
namespace pepeseg {
namespace {

// Splits a text into lines and counts them.
class Lines {
 public:
  // A byte order mark, as editors of Windows write it, is skipped.
  explicit Lines(absl::string_view text) : rest_(text) {
    absl::ConsumePrefix(&rest_, "\xef\xbb\xbf");
  }

  int number() const { return number_; }

  // Returns the next line without white space at both ends, or nothing after the last line.
  std::optional<absl::string_view> Next() {
    if (rest_.empty()) return std::nullopt;
    const size_t end = rest_.find('\n');
    const absl::string_view line = rest_.substr(0, end);
    rest_.remove_prefix(end == absl::string_view::npos ? rest_.size() : end + 1);
    ++number_;
    return absl::StripAsciiWhitespace(line);
  }

  // Returns the line after the last one, and leaves it to be read; nothing after the last line.
  std::optional<absl::string_view> Peek() const { return Lines(*this).Next(); }

  // Returns the next line that is neither empty nor a comment.
  std::optional<absl::string_view> NextRecord() {
    std::optional<absl::string_view> line = Next();
    while (line && (line->empty() || line->front() == '#')) line = Next();
    return line;
  }

 private:
  absl::string_view rest_;
  int number_ = 0;
};

// Takes fields, separated by blanks, from the front of a line. A missing field or one that is not a
// number yields 0 and makes ok() false for good.
class Fields {
 public:
  explicit Fields(absl::string_view line) : rest_(line) {}

  bool ok() const { return ok_; }
  bool empty() const { return rest_.empty(); }
  absl::string_view rest() const { return rest_; }

  absl::string_view Word() {
    // The rest of the line is kept as it is: a name may contain blanks.
    const size_t end = rest_.find_first_of(" \t");
    const absl::string_view word = rest_.substr(0, end);
    rest_.remove_prefix(word.size());
    rest_ = absl::StripLeadingAsciiWhitespace(rest_);
    ok_ = ok_ && !word.empty();
    return word;
  }
  template <class T>
  T Integer() {
    T value{};
    ok_ = absl::SimpleAtoi(Word(), &value) && ok_;
    return value;
  }
  double Number() {
    double value = 0;
    // "nan" and "inf" are numbers here: poses, lenses and points are checked where they are added.
    ok_ = absl::SimpleAtod(Word(), &value) && ok_;
    return value;
  }

 private:
  absl::string_view rest_;
  bool ok_ = true;
};

// Returns whether the line after an image's first one lists its 2D points: nothing, or numbers in
// threes (x, y, point id). Files written by hand often lack it.
bool IsPointsLine(absl::string_view line) {
  Fields fields(line);
  int num = 0;
  for (; !fields.empty(); ++num) {
    fields.Number();
    if (!fields.ok()) return false;
  }
  return num % 3 == 0;
}

// Returns "NAME: line N" for the line that was read last.
std::string LineOf(const std::string& name, const Lines& lines) {
  return absl::StrCat(name, ": line ", lines.number());
}

// Checks the number of records read so far, because a text file does not declare it.
absl::Status CheckLimit(size_t count, int64_t most, const std::string& name) {
  if (count < static_cast<size_t>(most)) return absl::OkStatus();
  return Refused(name, absl::StrCat("has more than ", most, " records"));
}

}  // namespace

absl::StatusOr<ColmapCameras> ParseCamerasText(absl::string_view text, const std::string& name) {
  ColmapCameras cameras;
  Lines lines(text);
  while (const auto line = lines.NextRecord()) {
    RETURN_IF_ERROR(CheckLimit(cameras.by_id.size(), kMaxViews, name));
    const std::string where = LineOf(name, lines);
    Fields fields(*line);
    const auto id = fields.Integer<uint32_t>();
    const absl::string_view model_name = fields.Word();
    const auto width = fields.Integer<int>();
    const auto height = fields.Integer<int>();
    if (!fields.ok()) return Refused(where, "not a camera: id, model, width, height, parameters");
    const std::optional<LensModel> model = LensModelByName(model_name);
    if (!model) return Refused(where, absl::StrCat("unknown camera model ", model_name));
    std::array<double, kMaxLensParameters> parameters{};
    for (int i = 0; i < NumParameters(*model); ++i) parameters[i] = fields.Number();
    if (!fields.ok() || !fields.empty()) {
      return Refused(where, absl::StrCat(model_name, " needs ", NumParameters(*model),
                                         " parameters, all of them numbers"));
    }
    const Lens lens = MakeLens(*model, width, height, parameters.data());
    RETURN_IF_ERROR(AddCamera(id, lens, where, cameras));
  }
  return cameras;
}

absl::StatusOr<std::vector<ColmapImage>> ParseImagesText(absl::string_view text,
                                                         const std::string& name) {
  std::vector<ColmapImage> images;
  Lines lines(text);
  while (const auto line = lines.NextRecord()) {
    RETURN_IF_ERROR(CheckLimit(images.size(), kMaxViews, name));
    const std::string where = LineOf(name, lines);
    Fields fields(*line);
    ColmapImage image;
    ColmapPose pose;
    image.id = fields.Integer<uint32_t>();
    for (double& value : pose.rotation) value = fields.Number();
    for (double& value : pose.translation) value = fields.Number();
    image.camera_id = fields.Integer<uint32_t>();
    image.name = std::string(fields.rest());  // a name may have spaces
    if (!fields.ok() || image.name.empty()) {
      return Refused(where, "not an image: id, qw, qx, qy, qz, tx, ty, tz, camera id, name");
    }
    RETURN_IF_ERROR(AddImage(std::move(image), pose, where, images));
    const auto next = lines.Peek();
    if (next && IsPointsLine(*next)) lines.Next();
  }
  return images;
}

absl::StatusOr<std::vector<ScenePoint>> ParsePointsText(absl::string_view text,
                                                        const std::string& name,
                                                        const Eigen::Vector3d& origin) {
  std::vector<ScenePoint> points;
  Lines lines(text);
  while (const auto line = lines.NextRecord()) {
    RETURN_IF_ERROR(CheckLimit(points.size(), kMaxPoints, name));
    Fields fields(*line);
    fields.Integer<uint64_t>();  // id
    Eigen::Vector3d xyz;
    for (double& value : xyz) value = fields.Number();
    int rgb[3];
    for (int& value : rgb) value = fields.Integer<int>();
    fields.Number();  // reprojection error; the track after it is skipped
    if (!fields.ok()) {
      return Refused(LineOf(name, lines), "not a point: id, x, y, z, r, g, b, error, track");
    }
    const absl::Status added = AddPoint(xyz, origin, rgb, points);
    if (!added.ok()) return Refused(LineOf(name, lines), added.message());
  }
  return points;
}

}  // namespace pepeseg
