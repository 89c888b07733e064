#pragma once
#include <px4_platform_common/atomic.h>
#include <px4_platform_common/log.h>
#include <string.h>

#define __EXPORT
#define PX4_OK 0
#define PX4_ERROR (-1)
#define PRINT_MODULE_DESCRIPTION(text) PX4_INFO("%s", text)
#define PRINT_MODULE_USAGE_NAME(name, category) PX4_INFO("%s (%s)", name, category)
#define PRINT_MODULE_USAGE_COMMAND(name) PX4_INFO("  %s", name)
#define PRINT_MODULE_USAGE_PARAM_STRING(letter, preset, kind, text, optional) PX4_INFO("    -%c %s", letter, text)
#define PRINT_MODULE_USAGE_DEFAULT_COMMANDS() PX4_INFO("  stop, status")

static constexpr int task_id_is_work_queue = -2;

class ModuleBase {
  public:
    struct Descriptor {
        Descriptor(int (*spawn)(int, char**), int (*command)(int, char**), int (*usage)(const char*))
            : task_spawn(spawn), custom_command(command), print_usage(usage) {}
        int (*task_spawn)(int, char**);
        int (*custom_command)(int, char**);
        int (*print_usage)(const char*);
        px4::atomic<ModuleBase*> object{nullptr};
        int task_id{-1};
    };

    virtual ~ModuleBase() = default;
    virtual int print_status() { return 0; }
    bool should_exit() const { return _should_exit; }

    static int main(Descriptor& desc, int argc, char* argv[]) {
        ModuleBase* object = desc.object.load();
        if (argc < 2) return desc.print_usage("missing command");
        if (strcmp(argv[1], "start") == 0) return object != nullptr ? PX4_ERROR : desc.task_spawn(argc - 1, argv + 1);
        if (object == nullptr) return PX4_ERROR;
        if (strcmp(argv[1], "status") == 0) return object->print_status();
        if (strcmp(argv[1], "stop") != 0) return desc.custom_command(argc - 1, argv + 1);
        object->_should_exit = true;
        return PX4_OK;
    }

  protected:
    static void exit_and_cleanup(Descriptor& desc) {
        delete desc.object.load();
        desc.object.store(nullptr);
        desc.task_id = -1;
    }

  private:
    bool _should_exit{false};
};
