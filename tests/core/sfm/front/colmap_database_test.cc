#include "core/sfm/front/colmap_database.h"

#include <cmath>
#include <fstream>
#include <random>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "core/base/child_process.h"
#include "core/formats/images.h"
#include "core/sfm/front/sqlite_connection.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/textured_place.h"

namespace pepeseg {
namespace {

using ::testing::IsEmpty;

// All rows of a query, a text for each, with blobs in hexadecimal.
std::vector<std::string> Rows(const std::filesystem::path& path, const std::string& columns) {
  SqliteConnection connection(path);
  EXPECT_OK(connection.Open(false));
  SqliteStatement statement(connection, absl::StrCat("SELECT ", columns).c_str());
  std::vector<std::string> rows;
  while (true) {
    const absl::StatusOr<bool> any = statement.Next();
    EXPECT_OK(any);
    if (!any.ok() || !*any) return rows;
    rows.emplace_back(statement.Bytes(0));
  }
}

// The statements that made the tables and indices, without spaces.
std::vector<std::string> Schema(const std::filesystem::path& path) {
  std::vector<std::string> schema;
  for (std::string sql : Rows(path, "sql FROM sqlite_master WHERE sql IS NOT NULL ORDER BY name")) {
    std::erase_if(sql, [](unsigned char c) { return absl::ascii_isspace(c); });
    schema.push_back(sql);
  }
  return schema;
}

bool RunColmap(std::vector<std::string> arguments) {
  const auto program = FindProgram("colmap");
  if (!program.ok()) return false;
  ChildCommand command;
  command.program = *program;
  command.arguments = std::move(arguments);
  command.environment = {"QT_QPA_PLATFORM=offscreen"};
  command.log = "/dev/null";
  const auto end = RunChild(command, [](std::span<const std::string>) { return absl::OkStatus(); });
  return end.ok() && end->exit_code == 0 && end->signal == 0;
}

SfmFeatures RandomFeatures(int count, uint32_t seed) {
  std::mt19937 random(seed);
  SfmFeatures features;
  for (int i = 0; i < count; ++i) {
    features.keypoints.push_back({static_cast<float>(random() % 1000) / 3,
                                  static_cast<float>(random() % 1000) / 7,
                                  1 + static_cast<float>(random() % 100) / 10,
                                  static_cast<float>(random() % 600) / 100 - 3});
    for (int k = 0; k < SfmFeatures::kDescriptorSize; ++k) {
      features.descriptors.push_back(static_cast<uint8_t>(random()));
    }
  }
  return features;
}

DatabaseFeatures SmallDatabase() {
  return {.cameras = {{1, 2, 640, 480, {768, 320, 240, 0}, false},
                      {2, 2, 300, 200, {350.5, 150, 100, 0.01}, true}},
          .images = {{1, "c1/000001.jpg", 0, RandomFeatures(20, 1)},
                     {2, "c1/000002.jpg", 0, RandomFeatures(0, 2)},
                     {7, "c2/000003.png", 1, RandomFeatures(33, 3)}}};
}

ComparedPair SmallPair(size_t first, size_t second) {
  ComparedPair pair{first, second, {{0, 5}, {3, 2}, {19, 32}}, {}};
  pair.geometry.kind = TwoViewKind::kUncalibrated;
  pair.geometry.fundamental << 1, 2, 3, 4, 5, 6, 7, 8, 9;
  pair.geometry.inliers = {{0, 5}, {19, 32}};
  return pair;
}

class ColmapDatabaseTest : public ::testing::Test {
 protected:
  testing::TempFolder folder_;
  std::filesystem::path path_ = folder_ / "database.db";
};

TEST_F(ColmapDatabaseTest, ReturnsWhatWasWritten) {
  const DatabaseFeatures written = SmallDatabase();
  ASSERT_OK(CreateDatabase(path_, written));
  ASSERT_OK_AND_ASSIGN(const DatabaseFeatures read, ReadDatabaseFeatures(path_));
  ASSERT_EQ(read.cameras.size(), 2u);
  EXPECT_EQ(read.cameras[1].params, written.cameras[1].params);
  EXPECT_TRUE(read.cameras[1].knows_focal);
  EXPECT_EQ(read.cameras[0].width, 640);
  ASSERT_EQ(read.images.size(), 3u);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(read.images[i].id, written.images[i].id);
    EXPECT_EQ(read.images[i].name, written.images[i].name);
    EXPECT_EQ(read.images[i].camera, written.images[i].camera);
    EXPECT_EQ(read.images[i].features.descriptors, written.images[i].features.descriptors);
    ASSERT_EQ(read.images[i].features.size(), written.images[i].features.size());
    for (size_t k = 0; k < read.images[i].features.size(); ++k) {
      const Keypoint& got = read.images[i].features.keypoints[k];
      const Keypoint& want = written.images[i].features.keypoints[k];
      EXPECT_EQ(got.x, want.x);
      EXPECT_EQ(got.y, want.y);
      EXPECT_NEAR(got.scale, want.scale, 1e-5);
      EXPECT_NEAR(got.angle, want.angle, 1e-5);
    }
  }
}

TEST_F(ColmapDatabaseTest, HoldsPairsAsColmapNumbersThem) {
  const DatabaseFeatures features = SmallDatabase();
  ASSERT_OK(CreateDatabase(path_, features));
  ASSERT_OK(WritePairs(path_, features, std::vector{SmallPair(0, 2), SmallPair(0, 1)}));
  EXPECT_THAT(
      Rows(path_, "pair_id FROM matches ORDER BY pair_id"),
      ::testing::ElementsAre(absl::StrCat(2147483647ll + 2), absl::StrCat(2147483647ll + 7)));
  EXPECT_THAT(Rows(path_,
                   "rows || ' ' || cols || ' ' || config || ' ' || hex(data) "
                   "FROM two_view_geometries WHERE pair_id = 2147483654"),
              ::testing::ElementsAre("2 2 3 00000000050000001300000020000000"));
  // Row by row, so that the second number is at byte 8.
  EXPECT_EQ(Rows(path_, "hex(substr(F, 9, 8)) FROM two_view_geometries")[0], "0000000000000040");
}

TEST_F(ColmapDatabaseTest, StaysAsItWasIfAPairCannotBeWritten) {
  const DatabaseFeatures features = SmallDatabase();
  ASSERT_OK(CreateDatabase(path_, features));
  const std::vector<ComparedPair> twice = {SmallPair(0, 2), SmallPair(1, 2), SmallPair(0, 2)};
  EXPECT_STATUS(WritePairs(path_, features, twice), absl::StatusCode::kInternal, "UNIQUE");
  EXPECT_THAT(Rows(path_, "pair_id FROM matches"), IsEmpty());
}

TEST_F(ColmapDatabaseTest, HasTheTablesOfColmap) {
  if (!RunColmap({"database_creator", "--database_path", (folder_ / "theirs").string()})) {
    GTEST_SKIP() << "this machine has no COLMAP";
  }
  ASSERT_OK(CreateDatabase(path_, {}));
  EXPECT_EQ(Schema(path_), Schema(folder_ / "theirs"));
}

// Writes again what COLMAP wrote and compares the bytes.
TEST_F(ColmapDatabaseTest, HasTheBytesOfColmap) {
  const std::filesystem::path theirs = folder_ / "theirs";
  std::filesystem::create_directory(folder_ / "images");
  for (const View& view : testing::PhotographPlace(testing::PlaceArc(3), 1)) {
    std::ofstream(folder_ / "images" / absl::StrCat(view.name, ".jpg"), std::ios::binary)
        << EncodeJpeg(view.photo, 95).value();
  }
  if (!RunColmap({"feature_extractor", "--database_path", theirs.string(), "--image_path",
                  (folder_ / "images").string(), "--SiftExtraction.use_gpu", "0",
                  "--ImageReader.camera_model", "SIMPLE_RADIAL",
                  "--SiftExtraction.max_num_features", "200"}) ||
      !RunColmap({"exhaustive_matcher", "--database_path", theirs.string(),
                  "--SiftMatching.use_gpu", "0"})) {
    GTEST_SKIP() << "this machine has no COLMAP";
  }
  ASSERT_OK_AND_ASSIGN(const DatabaseFeatures features, ReadDatabaseFeatures(theirs));
  ASSERT_EQ(features.images.size(), 3u);
  EXPECT_GT(features.images[0].features.size(), 100u);
  ASSERT_OK(CreateDatabase(path_, features));
  std::vector<ComparedPair> pairs;
  for (const auto& [first, second] : {std::pair(0, 1), std::pair(0, 2), std::pair(1, 2)}) {
    ComparedPair& pair = pairs.emplace_back();
    pair.first = first;
    pair.second = second;
    const int64_t id = features.images[first].id * 2147483647 + features.images[second].id;
    const auto data = Rows(theirs, absl::StrCat("data FROM matches WHERE pair_id = ", id));
    ASSERT_EQ(data.size(), 1u);
    pair.matches.resize(data[0].size() / sizeof(FeatureMatch));
    std::memcpy(pair.matches.data(), data[0].data(), data[0].size());
  }
  EXPECT_GT(pairs[0].matches.size(), 15u);
  ASSERT_OK(WritePairs(path_, features, pairs));
  for (const std::string columns :
       {"camera_id || ' ' || model || ' ' || width || ' ' || height || hex(params) || ' ' || "
        "prior_focal_length FROM cameras",
        "image_id || name || camera_id || typeof(prior_qw) || typeof(prior_tz) FROM images",
        "image_id || ' ' || rows || ' ' || cols || hex(data) FROM descriptors",
        "image_id || ' ' || rows || ' ' || cols || length(data) FROM keypoints",
        "pair_id || ' ' || rows || ' ' || cols || hex(data) FROM matches",
        "pair_id || ' ' || cols || typeof(F) || length(F) || typeof(E) || length(E) || typeof(H) "
        "|| length(H) || length(qvec) || length(tvec) FROM two_view_geometries",
        "name || seq FROM sqlite_sequence", "user_version FROM pragma_user_version"}) {
    EXPECT_EQ(Rows(path_, columns), Rows(theirs, columns)) << columns;
  }
  // The shapes of keypoints are made from angles, and so rounded.
  const auto own = Rows(path_, "data FROM keypoints"), want = Rows(theirs, "data FROM keypoints");
  for (size_t i = 0; i < want.size(); ++i) {
    for (size_t k = 0; k + sizeof(float) <= want[i].size(); k += sizeof(float)) {
      float one = 0, other = 0;
      std::memcpy(&one, own[i].data() + k, sizeof(float));
      std::memcpy(&other, want[i].data() + k, sizeof(float));
      ASSERT_NEAR(one, other, 1e-5 * (1 + std::abs(other)));
    }
  }
}

TEST_F(ColmapDatabaseTest, OfAnotherVersionIsRefused) {
  ASSERT_OK(CreateDatabase(path_, SmallDatabase()));
  {
    SqliteConnection connection(path_);
    ASSERT_OK(connection.Open(false));
    ASSERT_OK(connection.Execute("PRAGMA user_version = 3900"));
  }
  EXPECT_STATUS(ReadDatabaseFeatures(path_), absl::StatusCode::kFailedPrecondition,
                "of version 3900");
}

TEST_F(ColmapDatabaseTest, WithValuesOutOfRangeIsDamaged) {
  for (const char* damage :
       {"UPDATE keypoints SET rows = rows + 1 WHERE image_id = 1", "UPDATE keypoints SET cols = 5",
        "UPDATE descriptors SET data = x'00'", "UPDATE descriptors SET rows = -1",
        "DELETE FROM descriptors WHERE image_id = 7", "UPDATE images SET camera_id = 9",
        "UPDATE cameras SET params = x'0011'", "UPDATE cameras SET width = 0",
        "DROP TABLE keypoints", "UPDATE keypoints SET data = replace(hex(data), '0', 'F')"}) {
    std::filesystem::remove(path_);
    ASSERT_OK(CreateDatabase(path_, SmallDatabase()));
    {
      SqliteConnection connection(path_);
      ASSERT_OK(connection.Open(false));
      ASSERT_OK(connection.Execute(damage));
    }
    EXPECT_EQ(ReadDatabaseFeatures(path_).status().code(), absl::StatusCode::kDataLoss) << damage;
  }
}

// The last pages are those of the empty tables of pairs, which are not read.
TEST_F(ColmapDatabaseTest, CutShortIsAnErrorOrReadInFull) {
  const DatabaseFeatures features = SmallDatabase();
  ASSERT_OK(CreateDatabase(path_, features));
  const auto size = std::filesystem::file_size(path_);
  for (uintmax_t left = 0; left < size; left += size / 23) {
    std::filesystem::copy_file(path_, folder_ / "cut");
    std::filesystem::resize_file(folder_ / "cut", left);
    const auto read = ReadDatabaseFeatures(folder_ / "cut");
    if (read.ok()) {
      EXPECT_GT(left, size / 2);
      EXPECT_EQ(read->images[2].features.descriptors, features.images[2].features.descriptors);
    }
    std::filesystem::remove(folder_ / "cut");
  }
}

// Any result is right, as long as there is one.
TEST_F(ColmapDatabaseTest, WithFlippedBytesIsReadOrRefused) {
  ASSERT_OK(CreateDatabase(path_, SmallDatabase()));
  std::ifstream file(path_, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  std::mt19937 random(1);
  for (int round = 0; round < 200; ++round) {
    std::string damaged = bytes;
    for (int i = 0; i < 20; ++i) damaged[random() % damaged.size()] = static_cast<char>(random());
    std::ofstream(folder_ / "flipped", std::ios::binary) << damaged;
    const auto read = ReadDatabaseFeatures(folder_ / "flipped");
    if (!read.ok()) {
      EXPECT_NE(read.status().message(), "");
    }
  }
}

TEST_F(ColmapDatabaseTest, ThatIsMissingIsAnError) {
  EXPECT_STATUS(ReadDatabaseFeatures(path_), absl::StatusCode::kInternal, "cannot open");
  ASSERT_OK(CreateDatabase(path_, {}));
  EXPECT_STATUS(CreateDatabase(path_, {}), absl::StatusCode::kInternal, "exists already");
}

}  // namespace
}  // namespace pepeseg
