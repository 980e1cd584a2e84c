#include "server/api/resource_name.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

TEST(CheckId, AcceptsCommonNames) {
  for (const char* id : {"a", "apc-shelf2", "llff_horns", "Fern-2", "1a", "v1.0", "a-", "x.."}) {
    EXPECT_OK(CheckId(id, "scene_id")) << id;
  }
  EXPECT_OK(CheckId(std::string(63, 'x'), "scene_id"));
}

TEST(CheckId, RefusesNamesThatAreNotPlainFileNames) {
  for (const char* bad :
       {"", ".", "..", ".a", "-a", "_a", "a/b", "a b", "a\nb", "a%b", "a'b", "a\\b", "ä", "@1"}) {
    const absl::Status refused = CheckId(bad, "scene_id");
    EXPECT_TRUE(absl::IsInvalidArgument(refused)) << bad;
    EXPECT_NE(refused.message().find("beginning with a letter or a digit"), std::string::npos);
  }
  EXPECT_FALSE(CheckId(std::string(64, 'x'), "scene_id").ok());
  EXPECT_FALSE(CheckId(std::string("a\0b", 3), "scene_id").ok());
}

TEST(CheckProject, AcceptsRfc1034LabelsOnly) {
  EXPECT_OK(CheckProject("lab-2", "project"));
  for (const char* bad : {"", "Lab", "a_b", "a.b", "2a", "a-"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(CheckProject(bad, "project"))) << bad;
  }
}

// The scene "a", as a request names it with and without its project.
NamedScenes SceneA() {
  NamedScenes scenes;
  scenes.Add({"", "a", {}}, {7, "lab", "a"});
  scenes.Add({"lab", "a", {}}, {7, "lab", "a"});
  return scenes;
}

TEST(NamedScenes, ReadsTheNamesOfResources) {
  const NamedScenes scenes = SceneA();
  ASSERT_OK_AND_ASSIGN(const SceneRef a, scenes.Scene("scenes/a", "name"));
  EXPECT_EQ(a.id, 7);
  ASSERT_OK_AND_ASSIGN(const SceneChild child,
                       scenes.Child(ChildName(a, "datasets", 12), "datasets", "name"));
  EXPECT_EQ(child.scene, a);
  EXPECT_EQ(child.number, 12);
  ASSERT_OK_AND_ASSIGN(const SceneLabel label, scenes.Label(LabelName(a, "red-cup"), "name"));
  EXPECT_EQ(label.scene, a);
  EXPECT_EQ(label.id, "red-cup");
  EXPECT_EQ(scenes.Model("projects/lab/scenes/a/models/3", "model")->number, 3);
  EXPECT_EQ(scenes.Model("scenes/a/models/live", "model")->number, kLiveModel);
  EXPECT_EQ(*ParseJobName(JobName("j7"), "name"), "j7");
}

TEST(NamedScenes, RefusesEverythingElse) {
  const NamedScenes scenes = SceneA();
  for (const char* bad :
       {"", "shelf", "scenes/", "scenes/a/", "scenes/../x", "scenes/.a", "/a", "scenes/b",
        "projects/other/scenes/a", "projects/lab/scenes", "projects/a", "scenes/7@a"}) {
    const auto name = scenes.Scene(bad, "scene");
    EXPECT_TRUE(absl::IsInvalidArgument(name.status())) << bad;
    EXPECT_NE(name.status().message().find("scene: '"), std::string::npos) << name.status();
  }
  for (const char* bad :
       {"scenes/a/datasets/0", "scenes/a/datasets/01", "scenes/a/datasets/-1",
        "scenes/a/datasets/+1", "scenes/a/datasets/1x", "scenes/a/datasets/", "scenes/a/models/1",
        "scenes/a/datasets/99999999999999999999", "scenes/a/datasets/1/x"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(scenes.Child(bad, "datasets", "name").status())) << bad;
  }
  for (const char* bad : {"jobs/", "jobs/7", "jobs/j", "jobs/j0", "jobs/j1/x", "jobs/j../../x"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(ParseJobName(bad, "name").status())) << bad;
  }
  for (const char* bad :
       {"", "cup", "scenes/a/labels/", "scenes/a/labels/_cup", "scenes/a/labels/..",
        "scenes/a/models/cup", "scenes/../labels/cup", "scenes/a/labels/cup/x"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(scenes.Label(bad, "name").status())) << bad;
  }
  EXPECT_FALSE(scenes.Model("scenes/a/models/dead", "model").ok());
  EXPECT_FALSE(scenes.Scene("scenes/" + std::string(1 << 20, 'a'), "name").ok());
}

}  // namespace
}  // namespace pepeseg
