// SPDX-License-Identifier: GPL-3.0-or-later
// Job type for Flamenco: one frame by ranges of passes, and a merge of their films. See docs/farm.md.

const JOB_TYPE = {
    label: "Infrared Photons: Frame by Passes",
    description: "Render one frame by ranges of passes on many machines, and merge them",
    settings: [
        { key: "frame", type: "int32", required: true, eval: "C.scene.frame_current",
          description: "Frame to render" },
        { key: "last_pass", type: "int32", required: true, propargs: { min: 0 },
          eval: "max(0, C.scene.infrared.passes - 1)",
          description: "Passes are counted from 0" },
        { key: "passes_per_task", type: "int32", required: true, default: 8, propargs: { min: 1 },
          visible: "submission", description: "At most; tasks get about as many each" },
        { key: "target_noise", type: "float", default: 0.0, propargs: { min: 0.0 },
          description: "Kelvin; the merge fails above it, and says how many more passes it takes. 0 for none" },
        { key: "output_folder", type: "string", subtype: "dir_path", required: true,
          eval: "bpy.path.abspath('//')",
          description: "Folder of the films and of the merged image, which all machines see and which is there" },
        { key: "blendfile", type: "string", required: true, visible: "web",
          description: "The scene" },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    if (settings.last_pass < 0 || settings.passes_per_task < 1) {
        throw `last_pass is ${settings.last_pass}, expected 0 or more; ` +
            `passes_per_task is ${settings.passes_per_task}, expected 1 or more`;
    }
    const stem = path.join(settings.output_folder, job.name.replace(/[^\w.-]/g, "_"));
    const merge = author.Task("merge", "blender");
    for (const range of passRanges(settings.last_pass + 1, settings.passes_per_task)) {
        const film = `${stem}_frame${settings.frame}_${range}.npz`;
        const task = author.Task(`passes-${range}`, "blender");
        task.addCommand(blender(settings.blendfile, [
            "--command", "infrared_passes",
            "--frame", `${settings.frame}`,
            "--passes", range,
            "--film", film,
        ]));
        job.addTask(task);
        merge.addDependency(task);
    }
    merge.addCommand(blender("", [
        "--command", "infrared_merge",
        `${stem}_frame${settings.frame}_*.npz`, // each view layer and each eye has films of its own
        "--passes", `0-${settings.last_pass}`,
        "--target-noise", `${settings.target_noise || 0}`,
        "--output", `${stem}_####.exr`,
    ]));
    job.addTask(merge);
}

// Ranges such as "0-8" of passes from 0 to count - 1: as few as can be, and about as long each.
function passRanges(count, most) {
    const tasks = Math.ceil(count / most);
    const ranges = [];
    for (let i = 0; i < tasks; i++) {
        const first = Math.floor(i * count / tasks);
        const last = Math.floor((i + 1) * count / tasks) - 1;
        ranges.push(`${first}-${last}`);
    }
    return ranges;
}

function blender(blendfile, args) {
    return author.Command("blender-render", {
        exe: "{blender}",
        exeArgs: "{blenderArgs}",
        argsBefore: [],
        blendfile: blendfile,
        args: args,
    });
}
