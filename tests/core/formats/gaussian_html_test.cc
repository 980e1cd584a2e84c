#include "core/formats/gaussian_html.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <sstream>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "nlohmann/json.hpp"
#include "tests/testing/gaussian_file.h"

namespace pepeseg {
namespace {

using testing::AllOf;

// Returns what is between two texts, of which the page has the first once.
std::string Between(const std::string& page, const std::string& start, const std::string& end) {
  const size_t at = page.find(start);
  EXPECT_NE(at, std::string::npos) << start;
  if (at == std::string::npos) return "";
  EXPECT_EQ(page.find(start, at + 1), std::string::npos) << start;
  const size_t first = at + start.size();
  return page.substr(first, page.find(end, first) - first);
}

SplatPage ShelfPage() {
  SplatPage page;
  page.title = "shelf";
  page.camera = {.width = 640, .height = 480, .fx = 600, .fy = 610, .cx = 321, .cy = 239};
  page.cam_from_world.rotation = Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 2, 3).normalized());
  page.cam_from_world.translation = {0.1, 0.2, 3};
  page.near = 0.02;
  return page;
}

// Returns the SPZ in a page, as its script puts it together.
std::string SpzIn(const std::string& page) {
  std::istringstream lines(
      Between(page, "<script type=\"text/plain\" id=\"gaussians\">\n", "</script>"));
  std::string spz;
  for (std::string line; std::getline(lines, line);) {
    std::string part;
    EXPECT_TRUE(absl::Base64Unescape(line, &part));
    spz += part;
  }
  return spz;
}

TEST(GaussianHtmlBlocks, HoldAnSpzOfDegree0) {
  const Gaussians gaussians = testing::RandomGaussians(40'000, 3);
  const std::string page =
      testing::FileOf(GaussianHtmlBlocks(gaussians, AllOf(gaussians), ShelfPage()));
  const std::string spz = SpzIn(page);
  EXPECT_EQ(spz, testing::FileOf(GaussianSpzBlocks(gaussians, AllOf(gaussians), 0)));
  std::string bytes(16 + 40'000 * 20, '\0');
  z_stream stream = {};
  ASSERT_EQ(inflateInit2(&stream, 16 + MAX_WBITS), Z_OK);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(spz.data()));
  stream.avail_in = static_cast<uInt>(spz.size());
  stream.next_out = reinterpret_cast<Bytef*>(bytes.data());
  stream.avail_out = static_cast<uInt>(bytes.size());
  EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
  EXPECT_EQ(stream.total_out, bytes.size());
  inflateEnd(&stream);
  EXPECT_EQ(bytes[12], 0) << "the degree";
  EXPECT_EQ(static_cast<uint8_t>(bytes[8]) + 256 * static_cast<uint8_t>(bytes[9]), 40'000);
  EXPECT_LT(page.size(), 40'000u * 28);
  EXPECT_EQ(Between(page, "role=\"status\">", "<"), "40,000 Gaussians are loading");
}

TEST(GaussianHtmlBlocks, BeginAtTheCamera) {
  const Gaussians gaussians = testing::RandomGaussians(3, 0);
  const SplatPage want = ShelfPage();
  const std::string page = testing::FileOf(GaussianHtmlBlocks(gaussians, {1}, want));
  const auto camera = nlohmann::json::parse(
      Between(page, "<script type=\"application/json\" id=\"camera\">", "</script>"));
  EXPECT_EQ(camera.at("width"), 640);
  EXPECT_EQ(camera.at("fy"), 610);
  EXPECT_EQ(camera.at("cx"), 321);
  EXPECT_EQ(camera.at("near"), 0.02);
  const auto vector = [](const nlohmann::json& of) {
    return Eigen::Vector3d(of.at(0), of.at(1), of.at(2));
  };
  EXPECT_EQ(vector(camera.at("up")), Eigen::Vector3d(0, 1, 0)) << "y is up in an SPZ";
  // A point of the world is where the view has it: in the SPZ it is at x, -y, -z.
  const Eigen::Vector3d point(0.3, -0.4, 0.7);
  const Eigen::Vector3d from = Eigen::Vector3d(0.3, 0.4, -0.7) - vector(camera.at("position"));
  const Eigen::Vector3d in_camera = want.cam_from_world * point;
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(vector(camera.at("rotation").at(k)).dot(from), in_camera[k], 1e-12);
  }
}

TEST(GaussianHtmlBlocks, EscapeTheTitle) {
  const Gaussians gaussians = testing::RandomGaussians(3, 0);
  SplatPage shelf = ShelfPage();
  const std::string plain = testing::FileOf(GaussianHtmlBlocks(gaussians, {1}, shelf));
  shelf.title = "\"><script>alert('1')</script>&amp; {{camera}} {{gaussians}} Büro";
  const std::string page = testing::FileOf(GaussianHtmlBlocks(gaussians, {1}, shelf));
  const std::string escaped =
      "&quot;&gt;&lt;script&gt;alert(&#39;1&#39;)&lt;/script&gt;&amp;amp; {{camera}} "
      "{{gaussians}} Büro";
  EXPECT_EQ(Between(page, "<title>", "</title>"), escaped);
  EXPECT_EQ(Between(page, "aria-label=\"3D view of ", "\""), escaped);
  EXPECT_EQ(Between(page, "<b>", "</b>"), escaped);
  EXPECT_EQ(page.size(), plain.size() + 3 * (escaped.size() - 5));
  EXPECT_EQ(SpzIn(page), SpzIn(plain));
}

TEST(SplatPageOf, BeginsAtTheFirstView) {
  Model model;
  model.scene_radius = 3;
  const SplatPage none = SplatPageOf(model, "shelf");
  EXPECT_EQ(none.title, "shelf");
  EXPECT_GT(none.camera.width, 0);
  EXPECT_GT((none.cam_from_world * Eigen::Vector3d::Zero()).z(), 3) << "the model is in front";
  for (const double angle : {0.2, -0.2}) {  // views that lean to the left and to the right
    ModelView view;
    view.camera = ShelfPage().camera;
    view.cam_from_world.rotation = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ());
    view.cam_from_world.translation = {angle, 0, 0};
    model.views.push_back(view);
  }
  const SplatPage page = SplatPageOf(model, "shelf");
  EXPECT_EQ(page.camera, ShelfPage().camera);
  EXPECT_EQ(page.cam_from_world.translation.x(), 0.2);
  EXPECT_DOUBLE_EQ(page.near, 0.03);
  EXPECT_LT((page.up - Eigen::Vector3d(0, -1, 0)).norm(), 1e-9);
}

// A browser may have no network, and the page must not ask for one.
TEST(GaussianHtmlBlocks, LoadNothing) {
  const Gaussians gaussians = testing::RandomGaussians(3, 0);
  const std::string page = testing::FileOf(GaussianHtmlBlocks(gaussians, {}, ShelfPage()));
  for (const char* const word : {"http:", "https:", "src=", "href=", "import", "fetch("}) {
    EXPECT_EQ(page.find(word), std::string::npos) << word;
  }
  EXPECT_TRUE(absl::StrContains(page, "default-src 'none'"));
  // All of the template's names are replaced.
  EXPECT_EQ(page.find("{{"), std::string::npos);
}

}  // namespace
}  // namespace pepeseg
