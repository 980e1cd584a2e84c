#include "core/formats/ply_points.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/formats/colmap.h"
#include "core/formats/ply.h"

namespace pepeseg {

absl::StatusOr<std::vector<ScenePoint>> ReadPlyPoints(const std::filesystem::path& path,
                                                      const std::string& name,
                                                      const Eigen::Vector3d& origin) {
  constexpr const char* kNames[] = {"x", "y", "z", "red", "green", "blue"};
  constexpr float kGrey = 128;
  ASSIGN_OR_RETURN(const PlyVertices vertices, OpenPly(path, name, kMaxPoints));
  std::vector<std::vector<float>> values(6);
  std::vector<PlyColumn> columns;
  for (int i = 0; i < 6; ++i) {
    values[i].assign(static_cast<size_t>(vertices.count), kGrey);
    const int property = vertices.Find(kNames[i]);
    if (property >= 0) {
      columns.push_back({property, values[i], i < 3 ? origin[i] : 0});
    } else if (i < 3) {
      return absl::InvalidArgumentError(absl::StrCat(name, ": has no property ", kNames[i]));
    }
  }
  RETURN_IF_ERROR(ReadColumns(vertices, columns));
  std::vector<ScenePoint> points(static_cast<size_t>(vertices.count));
  for (size_t row = 0; row < points.size(); ++row) {
    for (int i = 0; i < 3; ++i) {
      points[row].position[i] = values[i][row];
      points[row].rgb[i] =
          static_cast<uint8_t>(std::lround(std::clamp(values[3 + i][row], 0.0f, 255.0f)));
    }
  }
  return points;
}

}  // namespace pepeseg
