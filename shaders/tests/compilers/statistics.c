// Compiles a compute shader in SPIR-V with a Vulkan driver, and prints what the driver says of the program, as "name,value":
//   statistics FILE ENTRY_POINT BINDINGS     a letter for each binding of group 0: u uniform buffer, s storage buffer
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <vulkan/vulkan.h>

#define MOST 64
#define TYPE(name) .sType = VK_STRUCTURE_TYPE_##name

static void check(VkResult result, const char *what) {
    if (result != VK_SUCCESS) {
        fprintf(stderr, "%s: VkResult %d\n", what, result);
        exit(1);
    }
}

static VkPhysicalDevice first_adapter(void) {
    VkApplicationInfo app = {TYPE(APPLICATION_INFO), .apiVersion = VK_API_VERSION_1_2};
    VkInstanceCreateInfo info = {TYPE(INSTANCE_CREATE_INFO), .pApplicationInfo = &app};
    VkInstance instance;
    VkPhysicalDevice adapter;
    uint32_t count = 1;
    check(vkCreateInstance(&info, NULL, &instance), "an instance");
    vkEnumeratePhysicalDevices(instance, &count, &adapter);
    check(count == 1 ? VK_SUCCESS : VK_ERROR_UNKNOWN, "an adapter");
    return adapter;
}

static VkDevice open_device(VkPhysicalDevice adapter) {
    VkPhysicalDevicePipelineExecutablePropertiesFeaturesKHR features = {
        TYPE(PHYSICAL_DEVICE_PIPELINE_EXECUTABLE_PROPERTIES_FEATURES_KHR), .pipelineExecutableInfo = VK_TRUE};
    float priority = 1;
    VkDeviceQueueCreateInfo queue = {TYPE(DEVICE_QUEUE_CREATE_INFO), .queueCount = 1, .pQueuePriorities = &priority};
    const char *extension = VK_KHR_PIPELINE_EXECUTABLE_PROPERTIES_EXTENSION_NAME;
    VkDeviceCreateInfo info = {TYPE(DEVICE_CREATE_INFO), .pNext = &features, .queueCreateInfoCount = 1,
        .pQueueCreateInfos = &queue, .enabledExtensionCount = 1, .ppEnabledExtensionNames = &extension};
    VkDevice device;
    check(vkCreateDevice(adapter, &info, NULL, &device), "a device");
    return device;
}

static VkShaderModule read_module(VkDevice device, const char *name) {
    static uint32_t words[1 << 18];
    FILE *file = fopen(name, "rb");
    size_t size = file ? fread(words, 1, sizeof words, file) : 0;
    VkShaderModuleCreateInfo info = {TYPE(SHADER_MODULE_CREATE_INFO), .codeSize = size, .pCode = words};
    VkShaderModule module;
    check(size > 0 && size < sizeof words ? VK_SUCCESS : VK_ERROR_UNKNOWN, name);
    check(vkCreateShaderModule(device, &info, NULL, &module), "a module");
    return module;
}

static VkPipelineLayout make_layout(VkDevice device, const char *letters) {
    VkDescriptorSetLayoutBinding bindings[MOST];
    uint32_t count = strlen(letters);
    for (uint32_t i = 0; i < count; i++)
        bindings[i] = (VkDescriptorSetLayoutBinding){.binding = i, .descriptorCount = 1, .stageFlags = VK_SHADER_STAGE_COMPUTE_BIT,
            .descriptorType = letters[i] == 'u' ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER};
    VkDescriptorSetLayoutCreateInfo set_info = {
        TYPE(DESCRIPTOR_SET_LAYOUT_CREATE_INFO), .bindingCount = count, .pBindings = bindings};
    VkDescriptorSetLayout set;
    VkPipelineLayoutCreateInfo info = {TYPE(PIPELINE_LAYOUT_CREATE_INFO), .setLayoutCount = 1, .pSetLayouts = &set};
    VkPipelineLayout layout;
    check(vkCreateDescriptorSetLayout(device, &set_info, NULL, &set), "a set");
    check(vkCreatePipelineLayout(device, &info, NULL, &layout), "a layout");
    return layout;
}

static VkPipeline compile(VkDevice device, VkShaderModule module, const char *entry_point, VkPipelineLayout layout) {
    VkComputePipelineCreateInfo info = {TYPE(COMPUTE_PIPELINE_CREATE_INFO),
        .flags = VK_PIPELINE_CREATE_CAPTURE_STATISTICS_BIT_KHR, .layout = layout,
        .stage = {TYPE(PIPELINE_SHADER_STAGE_CREATE_INFO), .stage = VK_SHADER_STAGE_COMPUTE_BIT, .module = module,
            .pName = entry_point}};
    VkPipeline pipeline;
    check(vkCreateComputePipelines(device, VK_NULL_HANDLE, 1, &info, NULL, &pipeline), "a pipeline");
    return pipeline;
}

static void print_statistics(VkDevice device, VkPipeline pipeline) {
    PFN_vkGetPipelineExecutableStatisticsKHR get =
        (PFN_vkGetPipelineExecutableStatisticsKHR)vkGetDeviceProcAddr(device, "vkGetPipelineExecutableStatisticsKHR");
    VkPipelineExecutableInfoKHR info = {TYPE(PIPELINE_EXECUTABLE_INFO_KHR), .pipeline = pipeline};
    VkPipelineExecutableStatisticKHR found[MOST];
    uint32_t count = MOST;
    for (uint32_t i = 0; i < MOST; i++)
        found[i] = (VkPipelineExecutableStatisticKHR){TYPE(PIPELINE_EXECUTABLE_STATISTIC_KHR)};
    check(get(device, &info, &count, found), "statistics");
    for (uint32_t i = 0; i < count; i++) printf("%s,%llu\n", found[i].name, (unsigned long long)found[i].value.u64);
}

int main(int count, char **arguments) {
    if (count != 4 || strlen(arguments[3]) > MOST) return 2;
    VkDevice device = open_device(first_adapter());
    VkShaderModule module = read_module(device, arguments[1]);
    print_statistics(device, compile(device, module, arguments[2], make_layout(device, arguments[3])));
    return 0;
}
