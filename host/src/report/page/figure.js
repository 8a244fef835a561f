// Makes figures interactive when they come near the window, and exports what they show as csv, svg
// and png.
const alive=new Map();   // figure's name → its charts
const pending=new Map(); // section and link → view of charts that are not interactive yet
const sectionOf=host=>host.closest('section')?.id||'';
function link(from,name,view){
  const section=sectionOf(from.host);
  pending.set(section+'/'+name,view);
  for(const charts of alive.values())for(const chart of charts){
    if(chart===from||!(chart instanceof Chart)||sectionOf(chart.host)!==section)continue;
    for(const key of['x','y'])if(chart.panel[key].link===name)chart.show({[key]:view});
  }
}
function enliven(element,figure){
  if(alive.has(figure.name))return alive.get(figure.name);
  const charts=[];
  alive.set(figure.name,charts);
  figure.panels.forEach((panel,i)=>{
    const host=element.querySelector(`[data-panel="${i}"] .plot`);
    panel.marks.forEach(unpackMark);
    if(panel.marks.some(m=>m.cells)){panel.marks.forEach(m=>m.columns=panel.x.names.length);charts.push(new Cells(figure,panel,host));return}
    if(panel.marks.some(m=>m.scene)){charts.push(new SceneView(figure,panel,host));host.classList.add('alive');return}
    const chart=new Chart(figure,panel,host);
    charts.push(chart);
    host.classList.add('alive');
    for(const key of['x','y']){const view=pending.get(sectionOf(host)+'/'+panel[key].link);if(panel[key].link&&view)chart.show({[key]:view})}
  });
  if(figure.name==='interface-modes')armsBelow(element);
  element.classList.add('ready');
  return charts;
}
// a matrix stays a static drawing, with a tooltip for each cell
class Cells{
  constructor(figure,panel,host){
    this.figure=figure;this.panel=panel;this.host=host;this.hidden=new Set();
    this.cells=panel.marks.find(m=>m.cells).cells;
    this.columns=panel.x.names.length;
    this.view={x:panel.x.range,y:panel.y.range,fixed:true};
    const rects=()=>[...host.querySelectorAll('rect[class^="f-"]')];
    const values=this.cells.values;
    // only known values are drawn
    const shown=[...values.keys()].filter(i=>Number.isFinite(values[i]));
    this.at=shown[0];
    host.addEventListener('pointermove',e=>{const n=rects().indexOf(e.target);if(n>=0)this.say(shown[n])});
    this.drawn=1;
  }
  say(i){
    this.at=i;
    this.host.closest('figure').querySelector('.readout').textContent=this.cells.says[i];
    if(this.figure.name==='participation')moveArms(partsOf(Math.floor(i/this.columns)));
  }
  marks(){return this.panel.marks}
  key(e){
    const by={ArrowLeft:-1,ArrowRight:1,ArrowUp:-this.columns,ArrowDown:this.columns}[e.key];
    if(!by)return false;
    let i=this.at+by;
    while(i in this.cells.values&&!Number.isFinite(this.cells.values[i]))i+=by;
    this.say(i in this.cells.values?i:this.at);return true;
  }
  whole(){}
}
function remember(chart){
  const{view,panel,figure}=chart,i=figure.panels.indexOf(panel),part=key=>view[key].map(v=>+v.toPrecision(9)).join(':')+':'+panel[key].scale;
  chart.fragment=`#view=${figure.name}/${i}/${part('x')}/${part('y')}`;
  const element=document.getElementById('fig-'+figure.name);
  element.dataset.fragment=chart.fragment;
}
function recall(){
  const m=/^#view=([a-z0-9-]+)\/(\d+)\/([^/:]+):([^/:]+):(log|linear)\/([^/:]+):([^/:]+):(log|linear)$/.exec(location.hash);
  const figure=m&&FIGURES.find(f=>f.name===m[1]);
  if(!figure||!figure.panels[m[2]])return;
  const element=document.getElementById('fig-'+m[1]),chart=enliven(element,figure)[m[2]];
  const[x0,x1,y0,y1]=[3,4,6,7].map(n=>Number(m[n]));
  if(chart instanceof Chart&&[x0,x1,y0,y1].every(Number.isFinite)){chart.spread('x',m[5]);chart.spread('y',m[8]);chart.zoom({x:[x0,x1],y:[y0,y1]});element.scrollIntoView()}
}
function toggle(figure,element,name,alone){
  const charts=enliven(element,figure),names=new Set(figure.panels.flatMap(p=>p.marks.map(m=>m.name).filter(Boolean)));
  const hidden=charts[0].hidden,others=[...names].filter(n=>n!==name);
  if(alone){const all=others.every(n=>hidden.has(n));for(const n of others)all?hidden.delete(n):hidden.add(n);hidden.delete(name)}
  else hidden.has(name)?hidden.delete(name):hidden.add(name);
  for(const c of charts){c.hidden=hidden;if(c.plot)c.plot.redraw()}
  for(const item of element.querySelectorAll('.legend li'))item.querySelector('button')?.setAttribute('aria-pressed',String(!hidden.has(item.dataset.name)));
}
// keyboard control of the figure that has the focus
function keysOf(element,figure){
  element.addEventListener('keydown',e=>{
    if(e.target.closest('button,a,summary')||e.ctrlKey||e.metaKey||e.altKey)return;
    const charts=enliven(element,figure),first=charts[0],taken=()=>{e.preventDefault();e.stopPropagation()};
    if(first.key){if(first.key(e))taken();return}
    const act={
      '+':()=>first.zoom({x:zoomed(first.panel.x,first.view.x,.7)}),'-':()=>first.zoom({x:zoomed(first.panel.x,first.view.x,1/.7)}),
      0:()=>charts.forEach(c=>c.whole()),ArrowRight:()=>first.step(e.shiftKey?20:1),ArrowLeft:()=>first.step(e.shiftKey?-20:-1),
    }[e.key];
    if(act){act();taken()}
  });
}
// the view as a separate SVG text, on a light background
function svgOf(figure,element){
  const charts=enliven(element,figure),columns=figure.columns,W=1040,gap=16,width=(W-gap*(columns-1))/columns;
  const light=root.dataset.light;root.dataset.light='light';
  const pen=new SvgPen();
  let top=52,below=top;
  figure.panels.forEach((panel,i)=>{
    if(i%columns===0)top=below;
    const left=(i%columns)*(width+gap),chart=charts[i];
    below=Math.max(below,panelInto(pen,panel,chart,left,top,width)+gap);
  });
  if(light===undefined)delete root.dataset.light;else root.dataset.light=light;
  const from=(figure.from.simulated?'SIMULATED rig. ':'')+figure.from.file+', jointrig '+figure.from.version;
  return`<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${W} ${below.toFixed(0)}" width="${W}" height="${below.toFixed(0)}" font-family='${FONT}'><rect width="100%" height="100%" fill="#ffffff"/><text x="8" y="22" font-size="17" font-weight="600" fill="#333333">${escapeText(figure.title)}</text><text x="8" y="42" font-size="12" fill="#333333">${escapeText(from)}</text>${pen.parts.join('')}</svg>`;
}
function panelInto(pen,panel,chart,x0,y0,width){
  const rows=panel.height==='rows',left=x0+(rows?12:panel.y.names?20+6.6*Math.max(...panel.y.names.map(n=>n.length)):64),right=x0+width-20,grid={colour:'#e4e4e4',width:1,dash:''},frame={colour:'#888888',width:1,dash:''};
  let top=y0+6;
  if(panel.title){pen.text(left,top+14,panel.title,'start','ink',14);top+=22}
  let x=left;
  const seen=new Set();
  if(!panel.named_above)for(const m of panel.marks)if(m.name&&!seen.has(m.name)&&!chart.hidden.has(m.name)){
    seen.add(m.name);
    const need=28+6.8*m.name.length+18;
    if(x>left&&x+need>right){x=left;top+=18}
    pen.path([[x,top+10],[x+22,top+10]],{...look(m.role),width:2});pen.text(x+28,top+14,m.name,'start','ink',12.5);
    x+=need;
  }
  if(seen.size)top+=24;
  if(chart instanceof SceneView){chart.paint(scenePen(pen,x0,top),width,SCENE_HIGH);return top+SCENE_HIGH}
  const box={left,right,top,bottom:top+frameHeight(panel,width)};
  const sx=scaleOf(panel.x,chart.view.x,left,right),sy=scaleOf(panel.y,chart.view.y,panel.y.names?box.top:box.bottom,panel.y.names?box.bottom:box.top);
  const xt=axisTicks(panel.x,chart.view.x,right-left,false),yt=rows?[]:axisTicks(panel.y,chart.view.y,box.bottom-box.top,true);
  for(const t of xt)if(!panel.x.names)pen.path([[sx(t.value),box.top],[sx(t.value),box.bottom]],grid);
  for(const t of yt)if(!panel.y.names)pen.path([[left,sy(t.value)],[right,sy(t.value)]],grid);
  pen.clipped(box,()=>{for(const m of chart.marks())drawMark(pen,m,sx,sy,box,look(m.role))});
  pen.path([[left,box.top],[right,box.top],[right,box.bottom],[left,box.bottom],[left,box.top]],frame);
  for(const t of xt)if(t.label)pen.text(sx(t.value),box.bottom+18,t.label,'middle','ink',12);
  for(const t of yt)if(t.label)pen.text(left-8,sy(t.value)+4,t.label,'end','ink',12);
  if(rows)panel.y.names.forEach((n,i)=>pen.text(left+8,sy(i)-3,n,'start','ink',13));
  pen.text((left+right)/2,box.bottom+37,labelOf(panel.x),'middle','ink',13);
  if(!panel.y.names)pen.text(x0+14,(box.top+box.bottom)/2,labelOf(panel.y),'middle','ink',13,true);
  return box.bottom+46;
}
const scaleOf=(axis,[a,b],from,to)=>v=>{
  if(!lin(axis)&&v<=0)return NaN;
  const share=(warp(axis,v)-warp(axis,a))/(warp(axis,b)-warp(axis,a));
  return from+share*(to-from);
};
// the data in view, one line for each point, in the format of report/csv.rs
function csvOf(figure,element){
  const charts=enliven(element,figure),lines=['panel,curve,horizontal,x,upright,y,low,high'];
  const quoted=t=>{t=/^[=+\-@\t]/.test(t)?"'"+t:t;return/[",\n\r]/.test(t)?`"${t.replace(/"/g,'""')}"`:t},num=v=>v===undefined||!Number.isFinite(v)?'':sixDigits(v);
  figure.panels.forEach((panel,i)=>{
    const chart=charts[i],[low,high]=chart instanceof Chart?chart.view.x:[-Infinity,Infinity],head=panel.title||String(i+1);
    for(const m of panel.marks){
      if(chart.hidden.has(m.name))continue;
      const tells=of=>(m.origin||[]).some(o=>o.of===of),nameAt=(axis,v)=>axis.names?axis.names[Math.max(0,Math.round(v))]:undefined;
      const xTold=tells('x')||tells('step')||panel.x.link==='cycle',told=(of,v)=>tells(of)?num(v):'';
      const across=v=>{const n=nameAt(panel.x,v);return n===undefined?(xTold?num(v):''):quoted(n)},upright=v=>{const n=nameAt(panel.y,v);return n===undefined?told('y',v):quoted(n)};
      const put=(x,...cells)=>{if(x===undefined||(x>=low&&x<=high))lines.push([quoted(head),quoted(m.name||m.role),quoted(labelOf(panel.x)),x===undefined?'':across(x),quoted(labelOf(panel.y)),...cells].join(','))};
      const c=m.line||m.loop;
      if(c&&tells('y')){const at=along(c.x);for(let n=0;n<c.y.length;n++)put(at(n),upright(c.y[n]),'','')}
      if(m.ribbon&&tells('low')){const at=along(m.ribbon.x);for(let n=0;n<m.ribbon.low.length;n++)put(at(n),'',num(m.ribbon.low[n]),num(m.ribbon.high[n]))}
      if(m.points&&(tells('x')||tells('y')))for(let n=0;n<m.points.x.length;n++)put(m.points.x[n],upright(m.points.y[n]),told('low',m.points.bars?.low[n]),told('high',m.points.bars?.high[n]));
      if(m.level&&tells('at'))put(undefined,num(m.level.at),'','');
      if(m.strips)m.strips.says.forEach((name,row)=>{const n=m.strips.x.length;for(let i=0;i<n;i++)if(m.strips.x[i]>=low&&m.strips.x[i]<=high)lines.push([quoted(head),quoted(name),quoted(labelOf(panel.x)),num(m.strips.x[i]),quoted(m.name),num(m.strips.values[row*n+i]),'',''].join(','))});
      if(m.cells)m.cells.values.forEach((v,n)=>{if(Number.isFinite(v))put(n%panel.x.names.length,upright(Math.floor(n/panel.x.names.length)),told('values',v),'')});
      if(m.scene)for(const s of m.scene.spots)lines.push([s.toward?'impact':'response',quoted(s.name),'x y z in m',num(s.at[0]),'',num(s.at[1]),num(s.at[2]),''].join(','));
    }
  });
  return lines.join('\n')+'\n';
}
