#include "core/sfm/front/colmap_database.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "core/base/status_macros.h"
#include "core/sfm/front/sqlite_connection.h"

namespace pepeseg {
namespace {

constexpr int kVersion = 3800;
constexpr int64_t kMostFeatures = 1 << 20;  // of a photograph
constexpr int kMostParams = 16;
// A pair's key is first id x this + second id, first < second.
constexpr int64_t kPairBase = 2147483647;

// The tables, with the columns and constraints of COLMAP 3.8.
constexpr char kSchema[] =
    "PRAGMA user_version = 3800;"
    "CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,"
    " model INTEGER NOT NULL, width INTEGER NOT NULL, height INTEGER NOT NULL, params BLOB,"
    " prior_focal_length INTEGER NOT NULL);"
    "CREATE TABLE images (image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,"
    " name TEXT NOT NULL UNIQUE, camera_id INTEGER NOT NULL,"
    " prior_qw REAL, prior_qx REAL, prior_qy REAL, prior_qz REAL,"
    " prior_tx REAL, prior_ty REAL, prior_tz REAL,"
    "CONSTRAINT image_id_check CHECK(image_id >= 0 and image_id < 2147483647),"
    "FOREIGN KEY(camera_id) REFERENCES cameras(camera_id));"
    "CREATE UNIQUE INDEX index_name ON images(name);"
    "CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,"
    " cols INTEGER NOT NULL, data BLOB,"
    "FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);"
    "CREATE TABLE descriptors (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,"
    " cols INTEGER NOT NULL, data BLOB,"
    "FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);"
    "CREATE TABLE matches (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,"
    " cols INTEGER NOT NULL, data BLOB);"
    "CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY NOT NULL,"
    " rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB, config INTEGER NOT NULL,"
    " F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB);";

absl::Status Malformed(const SqliteConnection& connection, absl::string_view what) {
  return absl::DataLossError(absl::StrCat(connection.path(), ": ", what));
}

absl::Status CheckVersion(const SqliteConnection& connection) {
  SqliteStatement statement(connection, "PRAGMA user_version");
  ASSIGN_OR_RETURN(const bool any, statement.Next());
  const int64_t version = any ? statement.Integer(0) : 0;
  if (version == kVersion) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat("the database is of version ", version,
                                                    ", not of COLMAP 3.8, which has ", kVersion));
}

// SQLite reads zeros from a last page that is cut short.
absl::Status CheckWholePages(const SqliteConnection& connection) {
  SqliteStatement statement(connection, "PRAGMA page_size");
  ASSIGN_OR_RETURN(const bool any, statement.Next());
  std::error_code error;
  const uintmax_t size = std::filesystem::file_size(connection.path(), error);
  if (any && !error && size % static_cast<uintmax_t>(statement.Integer(0)) == 0) {
    return absl::OkStatus();
  }
  return Malformed(connection, "is cut short");
}

absl::StatusOr<std::vector<DatabaseCamera>> ReadCameras(const SqliteConnection& connection) {
  SqliteStatement statement(connection,
                            "SELECT camera_id, model, width, height, params, prior_focal_length "
                            "FROM cameras ORDER BY camera_id");
  std::vector<DatabaseCamera> cameras;
  while (true) {
    ASSIGN_OR_RETURN(const bool any, statement.Next());
    if (!any) return cameras;
    DatabaseCamera& camera = cameras.emplace_back();
    camera.id = statement.Integer(0);
    camera.model = static_cast<int>(statement.Integer(1));
    camera.width = static_cast<int>(statement.Integer(2));
    camera.height = static_cast<int>(statement.Integer(3));
    camera.knows_focal = statement.Integer(5) != 0;
    const absl::string_view params = statement.Bytes(4);
    if (params.size() % sizeof(double) != 0 || params.size() > kMostParams * sizeof(double) ||
        camera.width <= 0 || camera.height <= 0) {
      return Malformed(connection, "a camera is malformed");
    }
    camera.params.resize(params.size() / sizeof(double));
    std::memcpy(camera.params.data(), params.data(), params.size());
  }
}

absl::StatusOr<std::vector<DatabaseImage>> ReadImages(const SqliteConnection& connection,
                                                      const std::vector<DatabaseCamera>& cameras) {
  std::map<int64_t, size_t> camera_of_id;
  for (size_t i = 0; i < cameras.size(); ++i) camera_of_id[cameras[i].id] = i;
  SqliteStatement statement(connection,
                            "SELECT image_id, name, camera_id FROM images ORDER BY image_id");
  std::vector<DatabaseImage> images;
  while (true) {
    ASSIGN_OR_RETURN(const bool any, statement.Next());
    if (!any) return images;
    const auto camera = camera_of_id.find(statement.Integer(2));
    const int64_t id = statement.Integer(0);
    if (camera == camera_of_id.end() || id <= 0 || id >= kPairBase) {
      return Malformed(connection, "a photograph is malformed");
    }
    images.push_back({id, std::string(statement.Bytes(1)), camera->second, {}});
  }
}

// Decodes float32 keypoints: x, y; x, y, scale, angle; or x, y and the 2x2 shape, whose columns
// have the length of the scale.
Keypoint KeypointOf(const char* bytes, int64_t num_columns) {
  float v[6] = {};
  std::memcpy(v, bytes, static_cast<size_t>(num_columns) * sizeof(float));
  if (num_columns == 2) return {v[0], v[1], 1, 0};
  if (num_columns == 4) return {v[0], v[1], v[2], v[3]};
  return {v[0], v[1], (std::hypot(v[2], v[4]) + std::hypot(v[3], v[5])) / 2,
          std::atan2(v[4], v[2])};
}

// Calls `take(image, rows, columns, bytes)` for the records of keypoints or descriptors.
template <class Take>
absl::Status ReadFeatureTable(const SqliteConnection& connection, const char* sql,
                              std::vector<DatabaseImage>& images, Take take) {
  std::map<int64_t, DatabaseImage*> image_of_id;
  for (DatabaseImage& image : images) image_of_id[image.id] = &image;
  SqliteStatement statement(connection, sql);
  while (true) {
    ASSIGN_OR_RETURN(const bool any, statement.Next());
    if (!any) return absl::OkStatus();
    const auto image = image_of_id.find(statement.Integer(0));
    const int64_t rows = statement.Integer(1);
    if (image == image_of_id.end() || rows < 0 || rows > kMostFeatures ||
        !take(*image->second, rows, statement.Integer(2), statement.Bytes(3))) {
      return Malformed(connection, "features are malformed");
    }
  }
}

bool TakeKeypoints(DatabaseImage& image, int64_t rows, int64_t columns, absl::string_view bytes) {
  if (columns != 2 && columns != 4 && columns != 6) return false;
  const int64_t size = columns * static_cast<int64_t>(sizeof(float));
  if (static_cast<int64_t>(bytes.size()) != rows * size) return false;
  for (int64_t row = 0; row < rows; ++row) {
    const Keypoint point = KeypointOf(bytes.data() + row * size, columns);
    if (!std::isfinite(point.x + point.y + point.scale + point.angle)) return false;
    image.features.keypoints.push_back(point);
  }
  return true;
}

bool TakeDescriptors(DatabaseImage& image, int64_t rows, int64_t columns, absl::string_view bytes) {
  if (columns != SfmFeatures::kDescriptorSize) return rows == 0;
  if (static_cast<int64_t>(bytes.size()) != rows * columns) return false;
  image.features.descriptors.assign(bytes.begin(), bytes.end());
  return true;
}

absl::Status WriteCameras(const SqliteConnection& connection, const DatabaseFeatures& features) {
  SqliteStatement statement(connection, "INSERT INTO cameras VALUES(?, ?, ?, ?, ?, ?)");
  for (const DatabaseCamera& camera : features.cameras) {
    statement.BindInteger(0, camera.id);
    statement.BindInteger(1, camera.model);
    statement.BindInteger(2, camera.width);
    statement.BindInteger(3, camera.height);
    statement.BindBytes(4, camera.params.data(), camera.params.size() * sizeof(double));
    statement.BindInteger(5, camera.knows_focal ? 1 : 0);
    RETURN_IF_ERROR(statement.Insert());
  }
  return absl::OkStatus();
}

// Writes a photograph's features with six columns, as COLMAP does.
absl::Status WriteFeatures(const SqliteConnection& connection, const DatabaseImage& image) {
  constexpr int kColumns = 6;
  std::vector<float> values;
  values.reserve(image.features.size() * kColumns);
  for (const Keypoint& point : image.features.keypoints) {
    const float along = point.scale * std::cos(point.angle);
    const float across = point.scale * std::sin(point.angle);
    values.insert(values.end(), {point.x, point.y, along, -across, across, along});
  }
  const auto insert = [&](const char* sql, int columns, const void* data, size_t size) {
    SqliteStatement statement(connection, sql);
    statement.BindInteger(0, image.id);
    statement.BindInteger(1, static_cast<int64_t>(image.features.size()));
    statement.BindInteger(2, columns);
    statement.BindBytes(3, data, size);
    return statement.Insert();
  };
  RETURN_IF_ERROR(insert("INSERT INTO keypoints VALUES(?, ?, ?, ?)", kColumns, values.data(),
                         values.size() * sizeof(float)));
  return insert("INSERT INTO descriptors VALUES(?, ?, ?, ?)", SfmFeatures::kDescriptorSize,
                image.features.descriptors.data(), image.features.descriptors.size());
}

void BindMatches(SqliteStatement& statement, int64_t pair_id,
                 const std::vector<FeatureMatch>& matches) {
  static_assert(sizeof(FeatureMatch) == 2 * sizeof(uint32_t));
  statement.BindInteger(0, pair_id);
  statement.BindInteger(1, static_cast<int64_t>(matches.size()));
  statement.BindInteger(2, 2);
  statement.BindBytes(3, matches.data(), matches.size() * sizeof(FeatureMatch));
}

using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// The relative pose stays zero: the mapper estimates that of its first pair itself.
absl::Status WriteGeometry(SqliteStatement& statement, int64_t pair_id,
                           const TwoViewGeometry& geometry) {
  constexpr double kNoPose[4] = {};
  const RowMajor matrices[] = {geometry.fundamental, geometry.essential, geometry.homography};
  BindMatches(statement, pair_id, geometry.inliers);
  statement.BindInteger(4, static_cast<int64_t>(geometry.kind));
  for (int i = 0; i < 3; ++i) statement.BindBytes(5 + i, matrices[i].data(), 9 * sizeof(double));
  statement.BindBytes(8, kNoPose, 4 * sizeof(double));
  statement.BindBytes(9, kNoPose, 3 * sizeof(double));
  return statement.Insert();
}

}  // namespace

absl::StatusOr<DatabaseFeatures> ReadDatabaseFeatures(const std::filesystem::path& path) {
  SqliteConnection connection(path);
  RETURN_IF_ERROR(connection.Open(/*create=*/false));
  RETURN_IF_ERROR(CheckVersion(connection));
  RETURN_IF_ERROR(CheckWholePages(connection));
  DatabaseFeatures features;
  ASSIGN_OR_RETURN(features.cameras, ReadCameras(connection));
  ASSIGN_OR_RETURN(features.images, ReadImages(connection, features.cameras));
  RETURN_IF_ERROR(ReadFeatureTable(connection, "SELECT image_id, rows, cols, data FROM keypoints",
                                   features.images, TakeKeypoints));
  RETURN_IF_ERROR(ReadFeatureTable(connection, "SELECT image_id, rows, cols, data FROM descriptors",
                                   features.images, TakeDescriptors));
  for (const DatabaseImage& image : features.images) {
    if (image.features.descriptors.size() != image.features.size() * SfmFeatures::kDescriptorSize) {
      return Malformed(
          connection,
          absl::StrCat(image.name, " has other numbers of keypoints and of descriptors"));
    }
  }
  return features;
}

DatabaseFeatures SortedByName(DatabaseFeatures features) {
  std::sort(features.images.begin(), features.images.end(),
            [](const DatabaseImage& a, const DatabaseImage& b) { return a.name < b.name; });
  std::map<size_t, size_t> new_index;  // of the cameras, in the order of their first photographs
  std::vector<DatabaseCamera> cameras;
  for (size_t i = 0; i < features.images.size(); ++i) {
    DatabaseImage& image = features.images[i];
    image.id = static_cast<int64_t>(i) + 1;
    const auto [found, is_new] = new_index.try_emplace(image.camera, cameras.size());
    if (is_new) {
      cameras.push_back(features.cameras[image.camera]);
      cameras.back().id = static_cast<int64_t>(cameras.size());
    }
    image.camera = found->second;
  }
  features.cameras = std::move(cameras);
  return features;
}

absl::Status CreateDatabase(const std::filesystem::path& path, const DatabaseFeatures& features) {
  SqliteConnection connection(path);
  RETURN_IF_ERROR(connection.Open(/*create=*/true));
  // The file is of no use after a crash, so nothing is waited for.
  RETURN_IF_ERROR(connection.Execute("PRAGMA synchronous = OFF; BEGIN"));
  RETURN_IF_ERROR(connection.Execute(kSchema));
  RETURN_IF_ERROR(WriteCameras(connection, features));
  SqliteStatement statement(connection,
                            "INSERT INTO images(image_id, name, camera_id) VALUES(?, ?, ?)");
  for (const DatabaseImage& image : features.images) {
    statement.BindInteger(0, image.id);
    statement.BindText(1, image.name);
    statement.BindInteger(2, features.cameras[image.camera].id);
    RETURN_IF_ERROR(statement.Insert());
    RETURN_IF_ERROR(WriteFeatures(connection, image));
  }
  return connection.Execute("COMMIT");
}

absl::Status WritePairs(const std::filesystem::path& path, const DatabaseFeatures& features,
                        std::span<const ComparedPair> pairs) {
  SqliteConnection connection(path);
  RETURN_IF_ERROR(connection.Open(/*create=*/false));
  RETURN_IF_ERROR(connection.Execute("PRAGMA synchronous = OFF; BEGIN"));
  SqliteStatement matches(connection, "INSERT INTO matches VALUES(?, ?, ?, ?)");
  SqliteStatement geometries(
      connection, "INSERT INTO two_view_geometries VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (const ComparedPair& pair : pairs) {
    const int64_t pair_id =
        features.images[pair.first].id * kPairBase + features.images[pair.second].id;
    BindMatches(matches, pair_id, pair.matches);
    RETURN_IF_ERROR(matches.Insert());
    RETURN_IF_ERROR(WriteGeometry(geometries, pair_id, pair.geometry));
  }
  return connection.Execute("COMMIT");
}

}  // namespace pepeseg
