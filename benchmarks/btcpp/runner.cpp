// Ticks an exported tree with BehaviorTree.CPP. Each leaf that is ticked is written to stdout by its name, and its answer (1 or 0) is
// read from stdin; the other side of the pipe is benchmarks/trees.py. Last line: SUCCESS or FAILURE.
#include <behaviortree_cpp/bt_factory.h>
#include <behaviortree_cpp/xml_parsing.h>

#include <fstream>
#include <iostream>
#include <regex>
#include <set>
#include <sstream>

using namespace BT;

static NodeStatus ask(const std::string& name)
{
  std::cout << name << std::endl;
  std::string answer;
  if(!std::getline(std::cin, answer))
    std::exit(2);
  return answer == "1" ? NodeStatus::SUCCESS : NodeStatus::FAILURE;
}

class Condition : public ConditionNode
{
public:
  using ConditionNode::ConditionNode;
  NodeStatus tick() override { return ask(name()); }
};

class Action : public SyncActionNode
{
public:
  using SyncActionNode::SyncActionNode;
  NodeStatus tick() override { return ask(name()); }
};

int main(int argc, char** argv)
{
  std::ifstream file(argv[1]);
  std::stringstream text;
  text << file.rdbuf();
  const std::string xml = text.str(), model = xml.substr(xml.find("<TreeNodesModel>"));
  BehaviorTreeFactory factory;
  std::regex node("<(Condition|Action) ID=\"(\\w+)\"( />|>([\\s\\S]*?)</(Condition|Action)>)"), port("name=\"(\\w+)\"");
  for(std::sregex_iterator one(model.begin(), model.end(), node), end; one != end; ++one)
  {
    const bool action = (*one)[1] == "Action";
    TreeNodeManifest manifest{ action ? NodeType::ACTION : NodeType::CONDITION, (*one)[2].str(), {}, {} };
    const std::string inside = (*one)[4].str();
    for(std::sregex_iterator each(inside.begin(), inside.end(), port); each != end; ++each)
      manifest.ports.insert(InputPort<std::string>((*each)[1].str()));
    factory.registerBuilder(manifest, [action](const std::string& name, const NodeConfig& config) -> std::unique_ptr<TreeNode> {
      if(action)
        return std::make_unique<Action>(name, config);
      return std::make_unique<Condition>(name, config);
    });
  }
  factory.registerBehaviorTreeFromText(xml);
  auto tree = factory.createTree("plan");
  NodeStatus status = NodeStatus::RUNNING;
  for(int tick = 0; tick < 20000 && status == NodeStatus::RUNNING; ++tick)
  {
    status = tree.tickOnce();
    if(status == NodeStatus::RUNNING)
      tree.sleep(std::chrono::milliseconds(2));
  }
  std::cout << toStr(status) << std::endl;
}
