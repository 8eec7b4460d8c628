// Runs the portable rules in a real MicroPython: node micropython.mjs PACKAGE_FOLDER FIRMWARE_FOLDER RULES_FILE
import { readFileSync, readdirSync } from "node:fs";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [packageFolder, firmware, rules] = process.argv.slice(2);
const { loadMicroPython } = await import(pathToFileURL(resolve(packageFolder, "micropython.mjs")));
const micropython = await loadMicroPython({ linebuffer: true, stdout: (line) => console.log(line) });
micropython.FS.mkdir("/board");
micropython.FS.mkdir("/board/hindrax_mcu");
for (const name of readdirSync(join(firmware, "hindrax_mcu")).filter((one) => one.endsWith(".py"))) {
  micropython.FS.writeFile(`/board/hindrax_mcu/${name}`, readFileSync(join(firmware, "hindrax_mcu", name)));
}
micropython.FS.writeFile("/board/rules.py", readFileSync(rules));
micropython.runPython(`
import sys
sys.path.insert(0, "/board")
import rules
names = sorted(name for name in dir(rules) if name.startswith("test_"))
for name in names:
    getattr(rules, name)()
print("passed %d on %s" % (len(names), sys.implementation.name))
`);
