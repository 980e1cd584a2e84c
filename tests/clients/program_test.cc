// Runs the real program without a server.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "tests/testing/temp_folder.h"

namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

struct Ran {
  int exit_code = -1;
  std::string output;
};

// Runs a program through the shell. Nothing listens on port 1, its default server.
Ran Run(const std::string& program, const std::string& arguments) {
  const std::string command = absl::StrCat("PEPESEG_SERVER=127.0.0.1:1 ", program, " ", arguments);
  FILE* pipe = popen(command.c_str(), "r");
  Ran ran;
  char buffer[4096];
  for (size_t size = 0; (size = fread(buffer, 1, sizeof(buffer), pipe)) > 0;) {
    ran.output.append(buffer, size);
  }
  const int status = pclose(pipe);
  ran.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return ran;
}

Ran RunPepeseg(const std::string& arguments) { return Run(PEPESEG_PROGRAM, arguments); }
Ran RunBenchmark(const std::string& arguments) {
  return Run(PEPESEG_PROGRAM "-benchmark", arguments);
}

TEST(Program, ListsVerbsAndExitCodesInItsHelp) {
  const Ran ran = RunPepeseg("--help");
  EXPECT_EQ(ran.exit_code, 0);
  for (const char* verb : {"upload", "train", "watch", "cancel", "jobs", "scenes", "segment",
                           "render", "label", "labels", "select", "selections", "combine", "edit",
                           "export", "mesh", "models", "completion", "Exit codes"}) {
    EXPECT_THAT(ran.output, HasSubstr(verb));
  }
}

TEST(Program, RefusesWrongCommandLines) {
  for (const char* arguments : {"",
                                "fly",
                                "upload",
                                "upload shelf",
                                "segment shelf --view a",
                                "segment shelf --view a --point 1,2 --scale 7",
                                "scenes --delete",
                                "models",
                                "models shelf --delete",
                                "models shelf 0",
                                "completion",
                                "completion fish",
                                "jobs --nonsense",
                                "label shelf cup --view a",
                                "label shelf cup --view a -p 1,2 --mask a.png",
                                "labels",
                                "select shelf --view a -p 1,2 --views 101",
                                "select shelf --view a -p 1,2 --add-to 1 --intersect 2",
                                "select shelf --view a -p 1,2 --add-to 0",
                                "selections shelf --undo",
                                "selections shelf 1 --undo --delete",
                                "combine shelf 1 with 2",
                                "combine shelf 1 union"}) {
    EXPECT_EQ(RunPepeseg(std::string(arguments) + " 2>&1").exit_code, 2) << arguments;
  }
}

TEST(Program, ListsChoicesByName) {
  for (const auto& [arguments, choices] :
       {std::pair("export shelf out --format nonsense",
                  "ply,spz,glb,sog,html,coco,yolo,labelme,masks,cvat,ids"),
        {"mesh shelf out --format nonsense", "ply,glb"},
        {"edit shelf burn --selection 1", "remove,keep,move,copy,recolor"},
        {"train shelf --preset nonsense", "preview,standard,best,paper"},
        {"segment shelf --view a -p 1,2 --frame nonsense", "photograph,view"}}) {
    const Ran ran = RunPepeseg(std::string(arguments) + " 2>&1");
    EXPECT_EQ(ran.exit_code, 2) << arguments;
    EXPECT_THAT(ran.output, AllOf(HasSubstr(choices), Not(HasSubstr("->"))));
  }
}

// No server answers: the command lines are accepted, and fail at the connection.
TEST(Program, TakesListsAndRepetitionsInAllOptionsOfNames) {
  for (const auto& [verb, option] : {std::pair("segment shelf --view a -p 1,2", "--views"),
                                     {"render shelf", "--views"},
                                     {"export shelf out --format coco", "--views"},
                                     {"train shelf", "--held-out-views"},
                                     {"estimate shelf", "--held-out-views"}}) {
    for (const std::string& names :
         {absl::StrCat(option, " a,b"), absl::StrCat(option, " a ", option, " b,c")}) {
      const Ran ran = RunPepeseg(absl::StrCat(verb, " ", names, " 2>&1"));
      EXPECT_EQ(ran.exit_code, 5) << verb << " " << names << ": " << ran.output;
    }
    const std::string name = std::string(verb).substr(0, std::string(verb).find(' '));
    EXPECT_THAT(RunPepeseg(name + " --help").output, HasSubstr("separated by commas, or"));
  }
}

TEST(Program, RefusesOptionsOfAnotherFormatOfExport) {
  const Ran gaussians = RunPepeseg("export shelf a.json --format coco --selection 1 2>&1");
  EXPECT_EQ(gaussians.exit_code, 4);
  EXPECT_THAT(gaussians.output, HasSubstr("leave out --selection"));
  const Ran views = RunPepeseg("export shelf a.ply --views all 2>&1");
  EXPECT_EQ(views.exit_code, 4);
  EXPECT_THAT(views.output, HasSubstr("--format"));
}

TEST(Program, PrintsItsVersion) {
  const Ran ran = RunPepeseg("--version");
  EXPECT_EQ(ran.exit_code, 0);
  EXPECT_THAT(ran.output, ::testing::MatchesRegex("pepeseg [0-9]+\\.[0-9]+.*\n"));
}

TEST(Program, ProposesSimilarVerbsAndOptions) {
  for (const auto& [arguments, meant] : {std::pair("tarin shelf", "`train`"),
                                         {"scene", "`scenes`"},
                                         {"train shelf --perset best", "`--preset`"},
                                         {"segment shelf --veiw a -p 1,2", "`--view`"},
                                         {"--sever host:1 scenes", "`--server`"},
                                         {"--server tarin scenes --jsn", "`--json`"}}) {
    const Ran ran = RunPepeseg(std::string(arguments) + " 2>&1");
    EXPECT_EQ(ran.exit_code, 2) << arguments;
    EXPECT_THAT(ran.output, HasSubstr(absl::StrCat("Did you mean ", meant))) << arguments;
  }
  EXPECT_THAT(RunPepeseg("fly 2>&1").output, Not(HasSubstr("Did you mean")));
}

TEST(Program, ProposesToStartAServerIfNoneAnswers) {
  const Ran ran = RunPepeseg("scenes 2>&1");
  EXPECT_EQ(ran.exit_code, 5);
  EXPECT_THAT(ran.output, HasSubstr("127.0.0.1:1"));
  const std::string server = std::filesystem::canonical(PEPESEG_PROGRAM).parent_path() / "pepesegd";
  ASSERT_TRUE(std::filesystem::exists(server));
  EXPECT_THAT(ran.output, HasSubstr("`" + server + " --listen 127.0.0.1:1`"));
}

TEST(Program, PrintsErrorsAsJson) {
  const Ran ran = RunPepeseg("--json scenes 2>/dev/null");
  EXPECT_EQ(ran.exit_code, 5);
  const auto json = nlohmann::json::parse(ran.output);
  EXPECT_EQ(json["error"]["exit_code"], 5);
  EXPECT_EQ(json["error"]["code"], "UNAVAILABLE");
}

TEST(Program, RefusesBadValuesBeforeItCallsAServer) {
  EXPECT_EQ(RunPepeseg("upload shelf /nowhere 2>&1").exit_code, 3);
  EXPECT_EQ(RunPepeseg("upload shelf " PEPESEG_TEST_DATA "/apc_shelf/sparse 2>&1").exit_code, 4);
  EXPECT_EQ(RunPepeseg("segment shelf --view a --point 1x2 2>&1").exit_code, 4);
  EXPECT_EQ(RunPepeseg("select shelf --view a --point 1x2 2>&1").exit_code, 4);
  EXPECT_EQ(RunPepeseg("label shelf cup --view a --point 1x2 2>&1").exit_code, 4);
  EXPECT_EQ(RunPepeseg("label shelf cup --view a --mask /nowhere 2>&1").exit_code, 3);
  EXPECT_EQ(RunPepeseg("train shelf --dataset 1 -o reconstruct.num_steps 2>&1").exit_code, 4);
  const Ran ran = RunPepeseg("train shelf --dataset 1 -o preset=quick 2>&1");
  EXPECT_EQ(ran.exit_code, 4);
  EXPECT_THAT(ran.output, HasSubstr("preview, standard, best, paper"));
}

TEST(Program, NamesLocalFilesThatCannotBeRead) {
  for (const char* arguments :
       {"upload shelf /nowhere", "segment shelf --view a --mask /nowhere.png",
        "select shelf --view a --mask /nowhere.png", "label shelf cup --view a --mask /nowhere.png",
        "scenes --key-file /nowhere.key", "scenes --tls --ca /nowhere.pem"}) {
    const Ran ran = RunPepeseg(std::string(arguments) + " 2>&1");
    EXPECT_EQ(ran.exit_code, 3) << arguments;
    EXPECT_THAT(ran.output, AllOf(HasSubstr("/nowhere"), Not(HasSubstr("pepeseg scenes"))));
  }
  const Ran ran = RunPepeseg("segment shelf --view a --mask / 2>&1");
  EXPECT_EQ(ran.exit_code, 4);
  EXPECT_THAT(ran.output, HasSubstr("Is a directory"));
}

TEST(Program, RefusesUnwritableOutputsBeforeItCallsAServer) {
  for (const Ran& ran :
       {RunPepeseg("export shelf /dev/null/x.ply 2>&1"),
        RunBenchmark("curves " PEPESEG_TEST_DATA "/apc_shelf --out /dev/null/x 2>&1"),
        RunBenchmark("demo --data " PEPESEG_TEST_DATA "/apc_shelf --out /dev/null/x 2>&1")}) {
    EXPECT_EQ(ran.exit_code, 3) << ran.output;
    EXPECT_THAT(ran.output, AllOf(HasSubstr("Not a directory"), HasSubstr("/dev/null"),
                                  Not(HasSubstr("gateway"))));
  }
}

TEST(BenchmarkProgram, ListsItsVerbsAndRefusesWrongCommandLines) {
  const Ran help = RunBenchmark("--help");
  EXPECT_EQ(help.exit_code, 0);
  for (const char* text : {"demo", "evaluate", "suite", "curves", "Exit codes"}) {
    EXPECT_THAT(help.output, HasSubstr(text));
  }
  for (const char* arguments : {"", "upload", "evaluate shelf", "suite nvos"}) {
    EXPECT_EQ(RunBenchmark(std::string(arguments) + " 2>&1").exit_code, 2) << arguments;
  }
  EXPECT_THAT(RunBenchmark("evaluate shelf labels --protocol nonsense 2>&1").output,
              HasSubstr("clicks,label-propagation,label-propagation-pixels,prompt,"));
  EXPECT_EQ(RunBenchmark("evaluate shelf /tmp --views a,b --views c 2>&1").exit_code, 5);
}

TEST(BenchmarkProgram, NamesLocalFilesThatCannotBeRead) {
  for (const char* arguments : {"evaluate shelf /nowhere", "evaluate shelf / --names /nowhere.json",
                                "curves /nowhere", "demo --data /nowhere"}) {
    const Ran ran = RunBenchmark(std::string(arguments) + " 2>&1");
    EXPECT_EQ(ran.exit_code, 3) << arguments;
    EXPECT_THAT(ran.output, AllOf(HasSubstr("/nowhere"), Not(HasSubstr("pepeseg scenes"))));
  }
  EXPECT_EQ(RunBenchmark("evaluate shelf / --names /dev/null 2>&1").exit_code, 4);
}

TEST(Program, ListsFilesWithTheirKindsInADryRun) {
  const Ran ran = RunPepeseg("upload shelf --dry-run " PEPESEG_TEST_DATA "/apc_shelf 2>/dev/null");
  EXPECT_EQ(ran.exit_code, 0);
  EXPECT_THAT(ran.output, HasSubstr("POSES                  sparse/0/cameras.bin"));
  EXPECT_THAT(ran.output, HasSubstr("IGNORE_MASK            ignore_mask.png"));
}

TEST(Program, SaysWhyAFileIsLeftOut) {
  const pepeseg::testing::TempFolder folder;
  for (const char* name : {"images/a.jpg", "images/a.MOV", "images/b.bmp", "depth/a.tiff",
                           "ignore/a.jpg", "notes.txt"}) {
    std::filesystem::create_directories((folder / name).parent_path());
    std::ofstream(folder / name) << "x";
  }
  const Ran ran = RunPepeseg("upload shelf --dry-run " + folder.path().string() + " 2>&1");
  EXPECT_EQ(ran.exit_code, 0);
  EXPECT_THAT(ran.output,
              AllOf(HasSubstr("images/a.MOV; it has the name of a photograph"),
                    HasSubstr("images/b.bmp; photographs are .jpg"),
                    HasSubstr("depth/a.tiff; depth maps are .png, .npy or .pfm"),
                    HasSubstr("ignore/a.jpg; ignore masks are .png"), HasSubstr("notes.txt\n")));
}

TEST(Program, ChecksWhatIsToBeFoundBeforeItCallsAServer) {
  EXPECT_THAT(RunPepeseg("--help").output, HasSubstr("find"));
  for (const char* arguments :
       {"find", "find shelf mug --max 201", "find shelf mug --min-score 2",
        "find shelf mug --format xml", "find shelf -p 1,1", "segment shelf --view a.jpg -p",
        "segment shelf", "segment shelf --text mug --label mug"}) {
    EXPECT_EQ(RunPepeseg(std::string(arguments) + " 2>&1").exit_code, 2) << arguments;
  }
  for (const char* arguments : {"find shelf", "find shelf mug --label mug"}) {
    EXPECT_EQ(RunPepeseg(std::string(arguments) + " 2>&1").exit_code, 4) << arguments;
  }
  EXPECT_EQ(RunPepeseg("find shelf mug 2>&1").exit_code, 5) << "no server";
}

TEST(Program, TakesIndicesInPlaceOfAPrompt) {
  const pepeseg::testing::TempFolder folder;
  const std::string file = (folder / "picked.txt").string();
  std::ofstream(file) << "1\n2\n";
  EXPECT_EQ(RunPepeseg("select shelf 2>&1").exit_code, 2);
  for (const char* also :
       {"--view a -p 1,2", "--label a", "--scale 0.5", "--threshold 0.5", "--no-sam-clicks"}) {
    EXPECT_EQ(
        RunPepeseg(absl::StrCat("select shelf --indices ", file, " ", also, " 2>&1")).exit_code, 2)
        << also;
  }
  const std::string none = (folder / "none.txt").string();
  EXPECT_EQ(RunPepeseg("select shelf --indices " + none + " 2>&1").exit_code, 3);
  EXPECT_EQ(RunPepeseg("select shelf --out . --indices " + file + " 2>&1").exit_code, 4);
  EXPECT_EQ(RunPepeseg("select shelf --add-to 1 --name some --indices " + file + " 2>&1").exit_code,
            5)
      << "no server";
}

TEST(Program, ChecksEditsBeforeItCallsAServer) {
  for (const char* arguments :
       {"edit", "edit shelf", "edit shelf remove", "edit shelf remove --without",
        "edit shelf remove --selection 1 --segment 0:1", "edit shelf remove --selection 0",
        "edit shelf remove --selection 1 --label cup", "edit shelf remove -p 1,2",
        "edit shelf move --selection 1 --scale 0", "edit shelf move --selection 1 --scale 1001",
        "edit shelf recolor --selection 1 --color \"#cc2200\" --strength 2"}) {
    EXPECT_EQ(RunPepeseg(std::string(arguments) + " 2>&1").exit_code, 2) << arguments;
  }
  for (const auto& [arguments, why] :
       {std::pair("move --selection 1", "--by, --rotate or --scale"),
        {"move --selection 1 --by 1,2", "X,Y,Z"},
        {"move --selection 1 --by 1,2,inf", "X,Y,Z"},
        {"move --selection 1 --scale 2 --about up", "--about"},
        {"move --selection 1 --rotate 90", "y,90"},
        {"move --selection 1 --rotate w,90", "y,90"},
        {"move --selection 1 --rotate 0,0,0,0", "y,90"},
        {"move --selection 1 --by 1,2,3 --fill", "--fill is of remove"},
        {"remove --selection 1 --scale 2", "--scale is of move and copy"},
        {"keep --selection 1 --fill", "--fill is of remove, not of keep"},
        {"remove --selection 1 --without --fill", "leave out --without"},
        {"recolor --selection 1", "#rrggbb"},
        {"recolor --selection 1 --color red", "#rrggbb"},
        {"recolor --selection 1 --color 0xcc22", "#rrggbb"},
        {"copy --selection 1 --by 1,2,3 --color cc2200", "--color is of recolor"},
        {"remove --segment 1", "LEVEL:ID"}}) {
    const Ran ran = RunPepeseg(absl::StrCat("edit shelf ", arguments, " 2>&1"));
    EXPECT_EQ(ran.exit_code, 4) << arguments;
    EXPECT_THAT(ran.output, HasSubstr(why)) << arguments;
  }
}

// No server answers: the command lines are accepted, and fail at the connection.
TEST(Program, TakesEveryFormOfAnEdit) {
  for (const char* arguments :
       {"remove --selection 1 --fill", "remove --view a -p 1,2 -n -3,4 --fill", "keep --label cup",
        "keep --segment 1:3 --scales 0.1,0.9", "remove --selection 1 --without",
        "move --selection 1 --by -0.1,0,2.5e-1", "move --selection 1 --rotate y,-90 --about 0,1,2",
        "copy --selection 1 --rotate 2,0,0,2 --scale 0.5",
        "recolor --view a --box 1,2,3,4 --color \"#CC2200\" --strength 0.5",
        "recolor --selection 1 --color cc2200 --model 3"}) {
    const Ran ran = RunPepeseg(absl::StrCat("edit shelf ", arguments, " 2>&1"));
    EXPECT_EQ(ran.exit_code, 5) << arguments << ": " << ran.output;
  }
}

TEST(Program, ChecksDecompositionsAndSubsetsBeforeItCallsAServer) {
  EXPECT_THAT(RunPepeseg("--help").output, HasSubstr("decompose"));
  for (const char* arguments :
       {"decompose", "decompose shelf --scales 0.1,2", "decompose shelf --level -1",
        "render shelf --content smell", "render shelf --scale 2",
        "render shelf --selection 1 --segment 1:1", "export shelf a.ply --selection 0",
        "export shelf a --format coco --segments -1",
        "mesh shelf a.ply --selection 1 --segment 1:1", "mesh shelf a.ply --voxels 31",
        "mesh shelf"}) {
    EXPECT_EQ(RunPepeseg(std::string(arguments) + " 2>&1").exit_code, 2) << arguments;
  }
  EXPECT_EQ(RunPepeseg("render shelf --segment 1 2>&1").exit_code, 4);
  EXPECT_EQ(RunPepeseg("export shelf a.ply --without 2>&1").exit_code, 4);
  EXPECT_EQ(RunPepeseg("mesh shelf a.ply --without 2>&1").exit_code, 4);
  EXPECT_EQ(RunPepeseg("mesh shelf a.glb --voxels 64 --watertight 2>&1").exit_code, 5)
      << "no server";
  EXPECT_EQ(RunPepeseg("decompose --scales 0.1,0.9 shelf 2>&1").exit_code, 5) << "no server";
}

}  // namespace
